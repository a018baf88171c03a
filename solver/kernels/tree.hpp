// The binary tree of neighbouring gaps, whose runs act on each other through charges.
//
// In its own coordinate η (gap.hpp) a gap acts on the others through charges q_i = w_i f_i at its
// nodes; the others' potentials g_i = (dθ/dη) g(θ_i) there are
//
//     g_i = -Σ_j K_ij q_j,      K_ij = (dθ/dη)_i (dθ/dη)_j / (4π sin²((θ_i - θ_j)/2)).
//
// A run of neighbouring gaps is an interval between two patches, just as a gap is one: in its
// coordinate all that lies outside is again on the line Im η = π/(2α), however narrow the patches
// at its ends. So it acts on the outside like a few charges at the Chebyshev nodes of a sine of η:
// the fewer the wider these patches are, so the widest divide the gaps into runs.
//
// With R the response of a run, q = q° - R g, a pair of neighbours 1, 2 obeys
//
//     g1 = E1 g - K12 q2,      g2 = E2 g - K21 q1,      q = E1ᵀ q1 + E2ᵀ q2:
//
// its potential g and the charges of both halves give g1 = c1 + D1 g and g2 = c2 + D2 g. Going up
// the tree gives R, c and D of every run, going down the potentials at every gap. The work grows as
// the number of gaps. The responses are symmetric, and the number of negative eigenvalues, that is
// stability at a fixed mean stress, is counted on the way up.
#pragma once

#include "equations.hpp"

namespace adhesis {

// Number of negative eigenvalues, and the distance of a gap's 2×2, or of the pair of a run's
// halves, from singular: 1 without interaction.
struct NegativeCount {
  int negative = 0;
  double nearest = 1;
};

// A run: one gap, or two neighbouring runs.
struct Run {
  std::array<int, 2> half = {-1, -1};  // of a gap none
  std::array<int, 2> range;            // first and last gap
  Gap interval = {};                   // not used of a whole period
  int rank = 0, room = 0;              // number of charges, and of those that there is room for
  std::array<int, 2> placed = {};      // ranks of its halves, for which it was placed
  NegativeCount count;                 // of its eigenvalues

  // Where the run's numbers begin in the arrays of the tree.
  int node = 0, response = 0, inverse = 0, kernel = 0, interpolation = 0;
};

// Charges of all runs for one load.
struct Charges {
  Vector isolated;              // q°, without potentials from outside the run
  Vector potential_of_sibling;  // c, of the other half of the parent, without any from outside that

  explicit Charges(int size = 0) : isolated(size), potential_of_sibling(size) {}
};

// First the L gaps, then pairs of runs, each behind its halves, the last one the whole.
struct Tree {
  std::vector<Run> runs;
  int count = 0;          // of gaps
  Vector theta, stretch;  // θ and dθ/dη of all charges
  Unset kernel;           // K12 of all pairs
  Unset interpolation;    // E of both halves of all pairs
  Unset response;         // R of all runs
  Unset inverse;          // (1 - K12 R2 K21 R1)⁻¹ of all pairs
  Unset inner_potential;  // D of both halves of all pairs

  // Allocate the tree of gaps, with room for so many times the charges.
  explicit Tree(const Nodes& nodes, double digits, double room = 1);

  int size() const { return int(theta.size()); }
  int run_count() const { return int(runs.size()); }

  // Put gap k, whose nodes are filled in, into the tree.
  void place_gap(const Nodes& nodes, int k);

  // Place the charges of a run, and compute its interpolation and kernel; the charges of which
  // halves have moved, if its own have not.
  void place_charges(int run, bool own = true, std::array<bool, 2> halves = {true, true});

  // Place the charges of a run anew, as those of halves have moved, and mark whether they have
  // moved themselves: the interval of a run does not change by gaps inside. Returns whether there
  // is room for as many as it needs.
  bool place_anew(int run, const std::vector<Gap>& gaps, double digits, Flags& moved);

  // Compute the response of a run from those of its halves.
  void factor(int run);

  // Compute the charges of a run from those of its halves, and the halves' potentials.
  void charge(int run, Charges& charges) const;

  // Compute the potentials of wanted runs for some loads; those that hold a wanted one must be
  // wanted, too.
  void pass_down(const Flags& wanted, std::span<const Charges> charges,
                 std::span<Vector> potential) const;
};

// Count the negative eigenvalues of [[h, 1], [1, r]], h and r symmetric, n×n, and overwritten.
//
// By pivots of two rows, one of each half: where h r is small they are far from singular. `nearest`
// is the least of their determinants, without sign: about the least eigenvalue of 1 - h r.
NegativeCount count_negative(double* h, double* r, int n);

}  // namespace adhesis
