"""Kernels of the methods sharp and grid."""

from collections.abc import Callable
import enum
from typing import Annotated, overload

import numpy
from numpy.typing import NDArray


COMPILER: str

class Panels:
    """The full-contact stress of a profile, compressed on panels."""

    def __init__(self, *, width: float, finest_count: int, x: NDArray[numpy.float64], w: NDArray[numpy.float64], stress: NDArray[numpy.float64], slope: NDArray[numpy.float64], tilt: NDArray[numpy.float64], pattern: NDArray[numpy.float64], half_plane: NDArray[numpy.float64], weights: NDArray[numpy.float64], level_start: NDArray[numpy.int64], end_x: NDArray[numpy.float64], end_w: NDArray[numpy.float64], short_count: int, length_x: NDArray[numpy.float64], length_w: NDArray[numpy.float64], length_before: NDArray[numpy.float64], top: int) -> None: ...

    def stress(self, theta: NDArray[numpy.float64]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
        """Evaluate S and S' at any angles."""

    def half_plane_opening(self, theta: NDArray[numpy.float64], side: int) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        Evaluate C and dC/dθ of half-plane cracks that begin (side 0) or end (1) at θ.
        """

class LoadingDevice:
    """
    Device that prescribes the value d = separation_weight·q0 s - compliance·p.
    """

    def __init__(self, separation_weight: float, compliance: float) -> None: ...

    @property
    def separation_weight(self) -> float: ...

    @property
    def compliance(self) -> float: ...

class FieldModel:
    """Inputs of a field besides its gaps and the prescribed value."""

    def __init__(self, device: LoadingDevice, digits: float, panels: Panels) -> None: ...

    @property
    def device(self) -> LoadingDevice: ...

    @property
    def digits(self) -> float: ...

    @property
    def panels(self) -> Panels: ...

class Adhesion:
    """Works of adhesion of edges; the contract is in edge_law.hpp."""

    @property
    def pins(self) -> bool: ...

    @property
    def least(self) -> float: ...

    @property
    def largest(self) -> float: ...

    def work(self, theta: float, recedes: bool) -> tuple[float, float]:
        """Evaluate w of an edge that advances or recedes at θ, and dw/dθ."""

    def work_up_to(self, theta: float, recedes: bool) -> float:
        """Integrate w dθ from 0 to θ."""

    def contact_work(self, gaps: NDArray[numpy.float64], recedes: bool = False) -> float:
        """Integrate w dθ over the patches between gaps."""

class ProfileAdhesion(Adhesion):
    """γ along the profile, and a constant ratio γ_open/γ."""

    def __init__(self, panels: Panels, ratio: float = 1.0, least: float = 1.0, largest: float = 1.0) -> None: ...

class PythonAdhesion(Adhesion):
    """A law of Python functions."""

    def __init__(self, pins: bool, least: float, largest: float, work: Callable[[float, bool], tuple[float, float]], work_up_to: Callable[[float, bool], float]) -> None: ...

class EdgeLaw:
    """Law by which the edges move, with the tolerances of one problem."""

    @overload
    def __init__(self, *, adhesion: Adhesion, critical: float, newton_tolerance: float, field_error: float, rest_step: float, longest_step: float, smallest: float, overlap_limit: float, force_error: float) -> None: ...

    @overload
    def __init__(self, arg: EdgeLaw, /) -> None: ...

    @property
    def critical(self) -> float: ...

    @critical.setter
    def critical(self, arg: float, /) -> None: ...

    @property
    def newton_tolerance(self) -> float: ...

    @newton_tolerance.setter
    def newton_tolerance(self, arg: float, /) -> None: ...

    @property
    def field_error(self) -> float: ...

    @field_error.setter
    def field_error(self, arg: float, /) -> None: ...

    @property
    def rest_step(self) -> float: ...

    @rest_step.setter
    def rest_step(self, arg: float, /) -> None: ...

    @property
    def longest_step(self) -> float: ...

    @longest_step.setter
    def longest_step(self, arg: float, /) -> None: ...

    @property
    def smallest(self) -> float: ...

    @smallest.setter
    def smallest(self, arg: float, /) -> None: ...

    @property
    def overlap_limit(self) -> float: ...

    @overlap_limit.setter
    def overlap_limit(self, arg: float, /) -> None: ...

    @property
    def force_error(self) -> float: ...

    @force_error.setter
    def force_error(self, arg: float, /) -> None: ...

    @property
    def memory(self) -> NDArray[numpy.float64]:
        """Gaps at the last state."""

    @memory.setter
    def memory(self, arg: NDArray[numpy.float64], /) -> None: ...

    def at_memory(self, gaps: NDArray[numpy.float64]) -> NDArray[numpy.bool_]:
        """Mark the edges at their memory; none where edges are not pinned."""

    def critical_of(self, gaps: NDArray[numpy.float64], opening: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
        """Compute C_c at every edge with the opening C."""

    def critical_openings(self, theta: NDArray[numpy.float64]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
        """Evaluate C_c of edges that advance, and its θ-derivative."""

def map_gaps(gaps: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
    """
    Make the table of gaps: both ends, widths of the patches beside them, α.
    """

def shortest_length(gaps: NDArray[numpy.float64]) -> float:
    """Find the length of the shortest gap or patch."""

class Field:
    """Solution of equation (1) of gap_field for given gaps."""

    @property
    def pressure(self) -> float:
        """p = 2p̄/E*; NaN if there is no solution."""

    @property
    def separation(self) -> float:
        """q0 s."""

    @property
    def unit_mean(self) -> float:
        """Xᵀ (B + G)⁻¹ X."""

    @property
    def resistance(self) -> float:
        """-2π/resistance is ∂p/∂d at fixed edges."""

    @property
    def opening(self) -> NDArray[numpy.float64]:
        """C at each edge."""

    @property
    def scaled_opening(self) -> NDArray[numpy.float64]:
        """f: the openings over sqrt(1-η²), at all nodes."""

    @property
    def orders(self) -> NDArray[numpy.int64]: ...

    @property
    def offset(self) -> NDArray[numpy.int64]: ...

    @property
    def theta(self) -> NDArray[numpy.float64]: ...

    @property
    def weight(self) -> NDArray[numpy.float64]:
        """X."""

    @property
    def load(self) -> NDArray[numpy.float64]:
        """S~."""

    def block(self, k: int) -> NDArray[numpy.float64]:
        """Diagonal block of B + G of a gap."""

    def edge_openings(self, scaled: NDArray[numpy.float64], with_end_terms: bool = True) -> NDArray[numpy.float64]:
        """Evaluate C at each edge from f at all nodes, of all modes."""

    def openings_by_prescribed(self) -> NDArray[numpy.float64]:
        """∂C/∂d at fixed edges."""

    def fine_opening(self, k: int, per_wave: float) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        Evaluate θ, T and the weight of ∫ T g dθ over T of a gap at fine nodes, and b_n.
        """

    def sum_modes(self, k: int, theta: NDArray[numpy.float64], modes: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
        """Sum b_n sin((n+1)t), cos t = η(θ), in gap k."""

    def refine_opening(self, k: int, modes: NDArray[numpy.float64], factor: int) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
        """
        Evaluate θ and T of gap k at about `factor` times as many nodes as modes.
        """

    def work_of_gaps(self) -> float:
        """Integrate S_full T dθ over the gaps."""

def sum_pull(theta: NDArray[numpy.float64], sine: NDArray[numpy.float64], cosine: NDArray[numpy.float64], weight: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
    """Sum weight_j / sin²((θ-φ_j)/2) over j, with sine and cosine of φ_j/2."""

def solve_field(gaps: NDArray[numpy.float64], prescribed: float, model: FieldModel, orders: NDArray[numpy.int64] | None = None) -> Field:
    """
    Solve the field of gaps, shape (L, 2); `orders` are those of their rules.
    """

class ResponseSolution:
    """All edges as a linear response has them at a prescribed value."""

    @property
    def motion(self) -> NDArray[numpy.float64]: ...

    @property
    def rate(self) -> NDArray[numpy.float64]: ...

    @property
    def pressure(self) -> float: ...

    @property
    def stable(self) -> bool: ...

class Equilibrium:
    """Equilibrium of all edges, if one was found."""

    @property
    def found(self) -> bool: ...

    @property
    def is_outgrown(self) -> bool: ...

    @property
    def corrections(self) -> int: ...

    @property
    def gaps(self) -> NDArray[numpy.float64]: ...

    @property
    def rate(self) -> NDArray[numpy.float64]: ...

    @property
    def pressure(self) -> float: ...

    @property
    def separation(self) -> float: ...

    @property
    def slope(self) -> float: ...

    @property
    def pinned_share(self) -> NDArray[numpy.float64]:
        """Place of C of pinned edges between both critical openings."""

    @property
    def pinned_rate(self) -> NDArray[numpy.float64]:
        """Its derivative by d."""

    def solve_field(self, prescribed: float, model: FieldModel) -> Field:
        """Solve every gap by itself in the potential of the others."""

class DescentEvent(enum.Enum):
    """Why a descent ended."""

    AT_REST = 0

    VANISHED = 1

    STEP_LIMIT = 2

    NO_FIELD = 3

    OUTGROWN = 4

class Descent:
    """Result of a descent."""

    @property
    def event(self) -> DescentEvent: ...

    @property
    def gaps(self) -> NDArray[numpy.float64]: ...

    @property
    def steps(self) -> int: ...

    @property
    def raced(self) -> bool: ...

class Running:
    """What a descent knows of the way that its edges have come."""

    def __init__(self, start: NDArray[numpy.float64], reach: float) -> None: ...

class LinearResponse:
    """Linear response of all gaps and their edges."""

    @property
    def gap_count(self) -> int: ...

    @property
    def orders(self) -> NDArray[numpy.int64]: ...

    @property
    def opening(self) -> NDArray[numpy.float64]:
        """C of every edge in its reference."""

    @property
    def potential(self) -> NDArray[numpy.float64]:
        """Potentials of the last solution, without p and by a unit of p."""

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""

    def update(self, gaps: NDArray[numpy.float64], prescribed: float, least: NDArray[numpy.int64] | None, law: EdgeLaw, model: FieldModel) -> LinearResponse | None:
        """Set up a response of gaps of which most are those of this one."""

    def count_unknown(self, gaps: NDArray[numpy.float64], law: EdgeLaw, model: FieldModel) -> int:
        """Count the gaps that `update` would not take over."""

    def settle(self, gaps: NDArray[numpy.float64], prescribed: float, law: EdgeLaw, model: FieldModel) -> bool:
        """Renew the response for a known equilibrium; False if it is outgrown."""

    def solve(self, prescribed: float, law: EdgeLaw, model: FieldModel) -> ResponseSolution: ...

    def solve_separately(self, gaps: NDArray[numpy.float64], pressure: float, prescribed: float, model: FieldModel) -> Field:
        """Solve every gap by itself in the potential of the last solution."""

    def tangent_between(self, gaps: NDArray[numpy.float64], edges: NDArray[numpy.int64], prescribed: float, law: EdgeLaw, model: FieldModel) -> NDArray[numpy.float64]:
        """
        Compute ∂(C_e - C_c)/∂n_f between some edges of these gaps.

        All others follow, but those at their memory, which are pinned.
        """

    def find_equilibrium(self, gaps: NDArray[numpy.float64], prescribed: float, reach: float, strict: bool, law: EdgeLaw, model: FieldModel) -> Equilibrium:
        """Find the equilibrium next to these gaps by Newton's iteration."""

    def descend(self, gaps: NDArray[numpy.float64], prescribed: float, most: int, equal_speeds: bool, running: Running, law: EdgeLaw, model: FieldModel) -> Descent:
        """Descend in energy until an event."""

def set_up_response(gaps: NDArray[numpy.float64], prescribed: float, least: NDArray[numpy.int64] | None, law: EdgeLaw, model: FieldModel) -> LinearResponse | None:
    """
    Solve the field of these gaps, and linearise about it; None if they have none.
    """

class SearchLengths:
    """Lengths of a search for touches, in 1/q0."""

    def __init__(self, *, max_displacement: float, closing_per_motion: float, surface: float, narrowest: float, widest: float) -> None: ...

    def seed_widths(self, curvature: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
        """Compute the widths of seeds at touches with these curvatures."""

    def clearances(self, opening: NDArray[numpy.float64], curvature: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
        """
        Compute the opening left at minima before a seed is put; not positive at a touch.
        """

class SearchedGaps:
    """Gaps as they were when they were last searched."""

    def __init__(self) -> None: ...

    def __getstate__(self) -> NDArray[numpy.float64]: ...

    def __setstate__(self, arg: NDArray[numpy.float64], /) -> None: ...

def search(field: Field, searched: SearchedGaps, lengths: SearchLengths) -> tuple[float, int, tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]], SearchedGaps]:
    """
    Find the least clearance of a field, searching only gaps that may have closed.

    Also returns the number of these gaps, their minima, and the updated searched gaps.
    """

def clearance_left(field: Field, searched: SearchedGaps, lengths: SearchLengths) -> NDArray[numpy.float64]:
    """Bound the clearance left in each gap from below."""

def least_clearances(field: Field, gaps: NDArray[numpy.int64], lengths: SearchLengths) -> NDArray[numpy.float64]:
    """Find the least clearance of some gaps."""

class TwoPoints:
    """Two points of a branch, `way` apart in d."""

    def __init__(self, gaps: NDArray[numpy.float64], rate: NDArray[numpy.float64], gaps_before: NDArray[numpy.float64], rate_before: NDArray[numpy.float64], way: float) -> None: ...

    def leading_edge(self) -> LeadingEdge:
        """Find the leading edge, and the fold ahead."""

    def other_fold(self, leading: int) -> tuple[int, float]:
        """
        Find the nearest fold ahead that other gaps lead to: edge and distance.
        """

    def predict_gaps(self, on: float, leading: LeadingEdge) -> NDArray[numpy.float64]:
        """Predict the gaps at a distance `on` in d."""

class LeadingEdge:
    """The edge that leads, and d along its motion."""

    @property
    def edge(self) -> int: ...

    @property
    def fastest(self) -> float: ...

    @property
    def gone(self) -> float: ...

    @property
    def here(self) -> float: ...

    @property
    def square(self) -> float: ...

    @property
    def cube(self) -> float: ...

    @property
    def fold(self) -> float: ...

    @property
    def fold_distance(self) -> float: ...

def dot(a: NDArray[numpy.float64], b: NDArray[numpy.float64]) -> float:
    """Sum a_i b_i, in an order that depends on their number alone."""

def total(values: NDArray[numpy.float64]) -> float:
    """Sum the values, in an order that depends on their number alone."""

def restrict(values: NDArray[numpy.float64], inside: NDArray[numpy.float64]) -> bool:
    """
    Set the values outside Ω to zero, in place; returns whether they all were.
    """

def residual_inside(target: NDArray[numpy.float64], displacement: NDArray[numpy.float64], inside: NDArray[numpy.float64], out: NDArray[numpy.float64]) -> float:
    """
    Compute the residual on Ω, zero elsewhere; returns the largest absolute one.
    """

def update_direction(direction: NDArray[numpy.float64], inside: NDArray[numpy.float64], correction: NDArray[numpy.float64], factor: float) -> None:
    """
    Set the next search direction: the correction on Ω plus `factor` times the last one.
    """

def advance(stress: NDArray[numpy.float64], displacement: NDArray[numpy.float64], residual: NDArray[numpy.float64], direction: NDArray[numpy.float64], response: NDArray[numpy.float64], inside: NDArray[numpy.float64], step: float) -> float:
    """
    Take a step along the direction; returns the largest absolute residual on Ω.
    """

def inverse_form(matrix: NDArray[numpy.float64], vector: NDArray[numpy.float64]) -> float:
    """Return bᵀA⁻¹b for a symmetric positive definite A; overwrites A."""

def gap_moments(gap: NDArray[numpy.float64], panels: Panels, modes: int, fields: int) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]:
    """
    Compute s_n of S, and with two fields of S', and the loads of both ends.
    """

def theta_at(gap: NDArray[numpy.float64], eta: float) -> tuple[float, float]:
    """Compute θ and dθ/dη at η."""

def fast_size(fewest: int) -> int:
    """Round up a number of nodes of a sine transform."""

def sine_sums(x: NDArray[numpy.float64]) -> NDArray[numpy.float64]:
    """Compute Σ_j x_j sin(π (j+1)(k+1)/N) of N - 1 numbers."""

def count_charges(gaps: NDArray[numpy.float64], digits: float) -> NDArray[numpy.int64]:
    """Count the charges of every run of the tree of gaps."""

def pair_runs(count: int) -> NDArray[numpy.int64]:
    """
    Pair neighbouring runs of gaps, level by level: the halves of every run.
    """

def pair_again(known: NDArray[numpy.int64], source: NDArray[numpy.int64]) -> tuple[NDArray[numpy.int64], NDArray[numpy.int64]]:
    """Pair the runs of gaps most of which are those of known halves."""

def count_negative(h: NDArray[numpy.float64], r: NDArray[numpy.float64]) -> int:
    """Count the negative eigenvalues of [[h, 1], [1, r]]."""

def solve_definite(matrix: NDArray[numpy.float64], load: NDArray[numpy.float64]) -> NDArray[numpy.float64] | None:
    """Solve a system; None if its matrix is not positive definite."""

def invert_definite(matrix: NDArray[numpy.float64]) -> NDArray[numpy.float64] | None:
    """Invert a matrix; None if it is not positive definite."""

def local_minima(theta: NDArray[numpy.float64], opening: NDArray[numpy.float64]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64]]:
    """Find local minima where θ falls: position, value, its error."""

def on_new_tree(response: LinearResponse, digits: float) -> tuple[NDArray[numpy.float64], int]:
    """
    Solve for the potentials of a response on a tree that is built anew, and count its negative eigenvalues.
    """

class EdgeModel:
    """Model of the edge openings about solved edges."""

    def __init__(self, edges: NDArray[numpy.int64], gaps: NDArray[numpy.float64], residual: NDArray[numpy.float64], tangent: NDArray[numpy.float64], law: EdgeLaw, panels: Panels) -> None: ...

    @property
    def opening(self) -> NDArray[numpy.float64]: ...

    @property
    def own(self) -> NDArray[numpy.float64]: ...

    @property
    def coupling(self) -> NDArray[numpy.float64]: ...

    @property
    def forces(self) -> NDArray[numpy.float64]: ...

    @property
    def hessian(self) -> NDArray[numpy.float64]: ...

    def advance(self, step: NDArray[numpy.float64]) -> None:
        """Move the edges outwards by these steps."""

    def flow(self, limit: NDArray[numpy.float64], equal_speeds: bool, is_long: bool, strongest: float, law: EdgeLaw) -> ModelFlow: ...

class ModelFlow:
    """Flow through the model."""

    def __init__(self, motion: NDArray[numpy.float64], opening: NDArray[numpy.float64], lengths: NDArray[numpy.float64], residuals: NDArray[numpy.float64]) -> None: ...

    @property
    def motion(self) -> NDArray[numpy.float64]: ...

    @property
    def lengths(self) -> NDArray[numpy.float64]: ...

    @property
    def is_at_limit(self) -> bool: ...

def implicit_step(hessian: NDArray[numpy.float64], force: NDArray[numpy.float64], longest: float, equal_speeds: bool) -> NDArray[numpy.float64]:
    """Take a linearly implicit step."""

def distance_to_minimum(hessian: NDArray[numpy.float64], force: NDArray[numpy.float64]) -> float:
    """
    Compute the largest motion to the minimum of a quadratic model; infinite without one.
    """

def model_error(flow: ModelFlow, residual: NDArray[numpy.float64], edges: NDArray[numpy.int64], gaps: NDArray[numpy.float64], law: EdgeLaw) -> float: ...

def next_reach(before: float, length: float, error: float) -> float: ...
