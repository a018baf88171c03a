#include "sine_transform.hpp"

#include <map>

namespace adhesis {

namespace {

// Complex numbers, real and imaginary parts apart.
struct Complex {
  Vector re, im;

  void resize(int count) {
    re.resize(count);
    im.resize(count);
  }
};

// Take `parts` butterflies of radix 4 for each of `stride`.
WIDE void take_fours(int parts, int stride, const Circle& circle, const Complex& x, Complex& out) {
  const int far = stride * parts;
  for (int p = 0; p < parts; ++p) {
    const int w = 4 * p * stride;
    const double c1 = circle.cosine[w], s1 = circle.sine[w];
    const double c2 = circle.cosine[2 * w], s2 = circle.sine[2 * w];
    const double c3 = circle.cosine[3 * w], s3 = circle.sine[3 * w];
    const double *re = &x.re[stride * p], *im = &x.im[stride * p];
    double* __restrict to_re = &out.re[4 * stride * p], * __restrict to_im =
                                                            &out.im[4 * stride * p];
    for (int q = 0; q < stride; ++q) {
      const double ac_re = re[q] + re[2 * far + q], ac_im = im[q] + im[2 * far + q];
      const double bd_re = re[far + q] + re[3 * far + q], bd_im = im[far + q] + im[3 * far + q];
      const double a_re = re[q] - re[2 * far + q], a_im = im[q] - im[2 * far + q];
      const double b_re = re[far + q] - re[3 * far + q], b_im = im[far + q] - im[3 * far + q];
      to_re[q] = ac_re + bd_re;
      to_im[q] = ac_im + bd_im;
      const double x1 = a_re - b_im, y1 = a_im + b_re;
      to_re[stride + q] = x1 * c1 - y1 * s1;
      to_im[stride + q] = x1 * s1 + y1 * c1;
      const double x2 = ac_re - bd_re, y2 = ac_im - bd_im;
      to_re[2 * stride + q] = x2 * c2 - y2 * s2;
      to_im[2 * stride + q] = x2 * s2 + y2 * c2;
      const double x3 = a_re + b_im, y3 = a_im - b_re;
      to_re[3 * stride + q] = x3 * c3 - y3 * s3;
      to_im[3 * stride + q] = x3 * s3 + y3 * c3;
    }
  }
}

// Take butterflies of another radix, of which there are few.
WIDE void take_others(int radix, int parts, int stride, const Circle& circle, const Complex& x,
                      Complex& out) {
  const int far = stride * parts, turn = 2 * circle.count;
  for (int p = 0; p < parts; ++p) {
    for (int k = 0; k < radix; ++k) {
      double* __restrict to_re = &out.re[(radix * p + k) * stride];
      double* __restrict to_im = &out.im[(radix * p + k) * stride];
      std::fill_n(to_re, stride, 0.0);
      std::fill_n(to_im, stride, 0.0);
      for (int a = 0; a < radix; ++a) {
        const int w = (4 * p * stride * k + turn / radix * (a * k % radix)) % turn;
        const double c = circle.cosine[w], s = circle.sine[w];
        const double *re = &x.re[stride * p + a * far], *im = &x.im[stride * p + a * far];
        for (int q = 0; q < stride; ++q) {
          to_re[q] += re[q] * c - im[q] * s;
          to_im[q] += re[q] * s + im[q] * c;
        }
      }
    }
  }
}

// Set x to Σ_j x_j exp(2πi j k/M), M a fourth of the circle's points; `other` is overwritten.
void transform(Complex& x, Complex& other, const Circle& circle) {
  int left = int(x.re.size()), stride = 1;
  while (left > 1) {
    const int radix = left % 4 == 0 ? 4 : left % 2 == 0 ? 2 : left % 3 == 0 ? 3 : 5;
    if (radix == 4)
      take_fours(left / 4, stride, circle, x, other);
    else
      take_others(radix, left / radix, stride, circle, x, other);
    left /= radix;
    stride *= radix;
    std::swap(x, other);
  }
}

}  // namespace

Circle::Circle(int count) : count(count), cosine(2 * count), sine(2 * count) {
  for (int j = 0; j < 2 * count; ++j) {
    cosine[j] = std::cos(pi * j / count);
    sine[j] = std::sin(pi * j / count);
  }
}

std::shared_ptr<const Circle> circle_of(int count) {
  constexpr int most = 1 << 16;
  thread_local std::map<int, std::shared_ptr<const Circle>> kept;
  if (count > most) return std::make_shared<const Circle>(count);
  auto& circle = kept[count];
  if (!circle) circle = std::make_shared<const Circle>(count);
  return circle;
}

void sine_sums(const Vector& x, const Circle& circle, Vector& out) {
  const int count = circle.count, half = count / 2;
  thread_local Complex sums, other;  // kept, as gaps of many sizes follow each other
  sums.resize(half);
  other.resize(half);
  sums.re[0] = 0;
  for (int j = 1; j < count; ++j) {
    const double a = x[j - 1], b = x[count - j - 1];
    const double y = circle.sine[j] * (a + b) + 0.5 * (a - b);
    (j % 2 == 1 ? sums.im : sums.re)[j / 2] = y;
  }
  transform(sums, other, circle);
  const Vector &re = sums.re, &im = sums.im;
  // Σ_j y_j exp(2πi j k/N) from even and odd j; its imaginary parts are the even sums, its real
  // parts the steps between the odd ones
  double odd = 0.5 * (re[0] + im[0]);
  out[0] = odd;
  for (int k = 1; k < half; ++k) {
    const int far = half - k;
    const double even_re = 0.5 * (re[k] + re[far]), even_im = 0.5 * (im[k] - im[far]);
    const double odd_re = 0.5 * (im[k] + im[far]), odd_im = 0.5 * (re[far] - re[k]);
    const double c = circle.cosine[2 * k], s = circle.sine[2 * k];
    out[2 * k - 1] = even_im + odd_re * s + odd_im * c;
    odd += even_re + odd_re * c - odd_im * s;
    out[2 * k] = odd;
  }
}

}  // namespace adhesis
