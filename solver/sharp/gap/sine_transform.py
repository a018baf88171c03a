"""Compute sine transforms, compiled: Σ_j x_j sin(π j k/N), N = 2^a 3^b 5^c with a ≥ 2.

A gap has some hundred nodes, and few gaps of a state have equally many: library calls from Python
cost more than the transforms. The N - 1 numbers are folded to N real ones, those are taken as N/2
complex ones for a Fourier transform (Stockham's, of mixed radix), and its two halves are separated
again (Press et al., Numerical Recipes, section 12.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both, compiled_sums

_ROTATIONS = 64  # before a cosine is computed anew, so that rounding does not grow
_THIRD = float(np.sqrt(0.75))
_C1, _S1 = float(np.cos(0.4 * np.pi)), float(np.sin(0.4 * np.pi))
_C2, _S2 = float(np.cos(0.8 * np.pi)), float(np.sin(0.8 * np.pi))


class Circle(NamedTuple):
    """Cosine and sine of π j/N for j = 0 … 2N - 1."""

    cosine: Array
    sine: Array


class Parts(NamedTuple):
    """Real and imaginary parts."""

    re: Array
    im: Array


@compiled_for_both
def tabulate_circle(count: int) -> Circle:
    """Tabulate the circle of N = ``count``, even."""
    cosine = np.empty(2 * count)
    sine = np.empty(2 * count)
    turn = np.pi / count
    c1, s1 = np.cos(turn), np.sin(turn)
    half = count // 2
    c, s = 1.0, 0.0
    for j in range(half + 1):
        if j % _ROTATIONS == 0:
            c = np.cos(turn * j)
            s = np.sin(turn * j)
        cosine[j] = c
        sine[j] = s
        c, s = c * c1 - s * s1, s * c1 + c * s1
    cosine[half] = 0.0
    sine[half] = 1.0
    for j in range(half + 1, count + 1):
        cosine[j] = -cosine[count - j]
        sine[j] = sine[count - j]
    for j in range(count + 1, 2 * count):
        cosine[j] = cosine[2 * count - j]
        sine[j] = -sine[2 * count - j]
    return Circle(cosine, sine)


@compiled_sums
def _butterflies_of_two(parts: int, stride: int, circle: Circle, x: Parts, out: Parts) -> None:
    """Take ``parts`` butterflies of radix 2 for each of ``stride``."""
    re, im, out_re, out_im = x.re, x.im, out.re, out.im
    far = stride * parts
    for p in range(parts):
        first = stride * p
        to = stride * 2 * p
        w1 = 4 * p * stride
        c1, s1 = circle.cosine[w1], circle.sine[w1]
        for q in range(stride):
            a_re, a_im = re[first + q], im[first + q]
            b_re, b_im = re[first + far + q], im[first + far + q]
            out_re[to + q] = a_re + b_re
            out_im[to + q] = a_im + b_im
            a_re -= b_re
            a_im -= b_im
            out_re[to + stride + q] = a_re * c1 - a_im * s1
            out_im[to + stride + q] = a_re * s1 + a_im * c1


@compiled_sums
def _butterflies_of_three(parts: int, stride: int, circle: Circle, x: Parts, out: Parts) -> None:
    """Take ``parts`` butterflies of radix 3 for each of ``stride``."""
    re, im, out_re, out_im = x.re, x.im, out.re, out.im
    far = stride * parts
    for p in range(parts):
        first = stride * p
        to = stride * 3 * p
        w1 = 4 * p * stride
        c1, s1 = circle.cosine[w1], circle.sine[w1]
        c2, s2 = circle.cosine[2 * w1], circle.sine[2 * w1]
        for q in range(stride):
            a_re, a_im = re[first + q], im[first + q]
            b_re, b_im = re[first + far + q], im[first + far + q]
            c_re, c_im = re[first + 2 * far + q], im[first + 2 * far + q]
            sum_re, sum_im = b_re + c_re, b_im + c_im
            off_re, off_im = _THIRD * (b_re - c_re), _THIRD * (b_im - c_im)
            out_re[to + q] = a_re + sum_re
            out_im[to + q] = a_im + sum_im
            a_re -= 0.5 * sum_re
            a_im -= 0.5 * sum_im
            x_re, x_im = a_re - off_im, a_im + off_re
            out_re[to + stride + q] = x_re * c1 - x_im * s1
            out_im[to + stride + q] = x_re * s1 + x_im * c1
            x_re, x_im = a_re + off_im, a_im - off_re
            out_re[to + 2 * stride + q] = x_re * c2 - x_im * s2
            out_im[to + 2 * stride + q] = x_re * s2 + x_im * c2


@compiled_sums
def _butterflies_of_four(parts: int, stride: int, circle: Circle, x: Parts, out: Parts) -> None:
    """Take ``parts`` butterflies of radix 4 for each of ``stride``."""
    re, im, out_re, out_im = x.re, x.im, out.re, out.im
    far = stride * parts
    for p in range(parts):
        first = stride * p
        to = stride * 4 * p
        w1 = 4 * p * stride
        c1, s1 = circle.cosine[w1], circle.sine[w1]
        c2, s2 = circle.cosine[2 * w1], circle.sine[2 * w1]
        c3, s3 = circle.cosine[3 * w1], circle.sine[3 * w1]
        for q in range(stride):
            a_re, a_im = re[first + q], im[first + q]
            b_re, b_im = re[first + far + q], im[first + far + q]
            c_re, c_im = re[first + 2 * far + q], im[first + 2 * far + q]
            d_re, d_im = re[first + 3 * far + q], im[first + 3 * far + q]
            ac_re, ac_im = a_re + c_re, a_im + c_im
            bd_re, bd_im = b_re + d_re, b_im + d_im
            a_re -= c_re
            a_im -= c_im
            b_re -= d_re
            b_im -= d_im
            out_re[to + q] = ac_re + bd_re
            out_im[to + q] = ac_im + bd_im
            x_re, x_im = a_re - b_im, a_im + b_re
            out_re[to + stride + q] = x_re * c1 - x_im * s1
            out_im[to + stride + q] = x_re * s1 + x_im * c1
            x_re, x_im = ac_re - bd_re, ac_im - bd_im
            out_re[to + 2 * stride + q] = x_re * c2 - x_im * s2
            out_im[to + 2 * stride + q] = x_re * s2 + x_im * c2
            x_re, x_im = a_re + b_im, a_im - b_re
            out_re[to + 3 * stride + q] = x_re * c3 - x_im * s3
            out_im[to + 3 * stride + q] = x_re * s3 + x_im * c3


@compiled_sums
def _butterflies_of_five(parts: int, stride: int, circle: Circle, x: Parts, out: Parts) -> None:
    """Take ``parts`` butterflies of radix 5 for each of ``stride``."""
    re, im, out_re, out_im = x.re, x.im, out.re, out.im
    far = stride * parts
    for p in range(parts):
        first = stride * p
        to = stride * 5 * p
        w1 = 4 * p * stride
        c1, s1 = circle.cosine[w1], circle.sine[w1]
        c2, s2 = circle.cosine[2 * w1], circle.sine[2 * w1]
        c3, s3 = circle.cosine[3 * w1], circle.sine[3 * w1]
        c4, s4 = circle.cosine[4 * w1], circle.sine[4 * w1]
        for q in range(stride):
            a_re, a_im = re[first + q], im[first + q]
            b_re, b_im = re[first + far + q], im[first + far + q]
            c_re, c_im = re[first + 2 * far + q], im[first + 2 * far + q]
            d_re, d_im = re[first + 3 * far + q], im[first + 3 * far + q]
            e_re, e_im = re[first + 4 * far + q], im[first + 4 * far + q]
            be_re, be_im = b_re + e_re, b_im + e_im
            cd_re, cd_im = c_re + d_re, c_im + d_im
            b_re -= e_re
            b_im -= e_im
            c_re -= d_re
            c_im -= d_im
            out_re[to + q] = a_re + be_re + cd_re
            out_im[to + q] = a_im + be_im + cd_im
            near_re = a_re + _C1 * be_re + _C2 * cd_re
            near_im = a_im + _C1 * be_im + _C2 * cd_im
            off_re = _S1 * b_re + _S2 * c_re
            off_im = _S1 * b_im + _S2 * c_im
            x_re, x_im = near_re - off_im, near_im + off_re
            out_re[to + stride + q] = x_re * c1 - x_im * s1
            out_im[to + stride + q] = x_re * s1 + x_im * c1
            x_re, x_im = near_re + off_im, near_im - off_re
            out_re[to + 4 * stride + q] = x_re * c4 - x_im * s4
            out_im[to + 4 * stride + q] = x_re * s4 + x_im * c4
            near_re = a_re + _C2 * be_re + _C1 * cd_re
            near_im = a_im + _C2 * be_im + _C1 * cd_im
            off_re = _S2 * b_re - _S1 * c_re
            off_im = _S2 * b_im - _S1 * c_im
            x_re, x_im = near_re - off_im, near_im + off_re
            out_re[to + 2 * stride + q] = x_re * c2 - x_im * s2
            out_im[to + 2 * stride + q] = x_re * s2 + x_im * c2
            x_re, x_im = near_re + off_im, near_im - off_re
            out_re[to + 3 * stride + q] = x_re * c3 - x_im * s3
            out_im[to + 3 * stride + q] = x_re * s3 + x_im * c3


@compiled
def _fourier(x: Parts, circle: Circle) -> Parts:
    """Sum z_j exp(2πi j k/M) over j; ``x`` is overwritten.

    The circle holds four times as many points as the transform.
    """
    count = x.re.shape[0]
    out = Parts(np.empty(count), np.empty(count))
    left = count
    stride = 1
    while left > 1:
        if left % 4 == 0:
            radix = 4
            _butterflies_of_four(left // 4, stride, circle, x, out)
        elif left % 2 == 0:
            radix = 2
            _butterflies_of_two(left // 2, stride, circle, x, out)
        elif left % 3 == 0:
            radix = 3
            _butterflies_of_three(left // 3, stride, circle, x, out)
        else:
            radix = 5
            _butterflies_of_five(left // 5, stride, circle, x, out)
        left //= radix
        stride *= radix
        x, out = out, x
    return x


@compiled_for_both
def sine_sums(x: Array, circle: Circle, out: Array) -> None:
    """Set out_k to Σ_j x_j sin(π (j+1)(k+1)/N), N - 1 = len(x), with the circle of N."""
    cosine, sine = circle.cosine, circle.sine
    count = x.shape[0] + 1
    half = count // 2
    re = np.empty(half)
    im = np.empty(half)
    re[0] = 0.0
    for j in range(1, count):
        a = x[j - 1]
        b = x[count - j - 1]
        y = sine[j] * (a + b) + 0.5 * (a - b)
        if j & 1:
            im[j >> 1] = y
        else:
            re[j >> 1] = y
    parts = _fourier(Parts(re, im), circle)
    re, im = parts.re, parts.im
    # Σ_j y_j exp(2πi j k/N) from even and odd j; its imaginary parts are the even sums, its
    # real parts the steps between the odd ones
    odd = 0.5 * (re[0] + im[0])
    out[0] = odd
    for k in range(1, half):
        far = half - k
        even_re = 0.5 * (re[k] + re[far])
        even_im = 0.5 * (im[k] - im[far])
        odd_re = 0.5 * (im[k] + im[far])
        odd_im = 0.5 * (re[far] - re[k])
        c, s = cosine[2 * k], sine[2 * k]
        out[2 * k - 1] = even_im + odd_re * s + odd_im * c
        odd += even_re + odd_re * c - odd_im * s
        out[2 * k] = odd
