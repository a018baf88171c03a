"""Kernels of the methods sharp and grid."""

from collections.abc import Sequence
import enum
from typing import Annotated, overload

import numpy
import numpy.typing
from numpy.typing import NDArray


COMPILER: str

CLOSING_SHARE: float

COMPARABLE: float

PREDICTION_TRUSTED: float

SHAPE_NODES: float

STEP_GROWTH: float

STEP_REDUCTION: float

class Panels:
    """The full-contact stress of a profile, compressed on panels."""

    def __init__(self, *, width: float, finest_count: int, x: numpy.typing.NDArray[numpy.float64], w: numpy.typing.NDArray[numpy.float64], stress: numpy.typing.NDArray[numpy.float64], slope: numpy.typing.NDArray[numpy.float64], tilt: numpy.typing.NDArray[numpy.float64], half_plane: Sequence[numpy.typing.NDArray[numpy.float64]], weights: Sequence[numpy.typing.NDArray[numpy.float64]], level_start: numpy.typing.NDArray[numpy.int64], end_x: numpy.typing.NDArray[numpy.float64], end_w: numpy.typing.NDArray[numpy.float64], short_count: int, length_x: numpy.typing.NDArray[numpy.float64], length_w: numpy.typing.NDArray[numpy.float64], length_before: numpy.typing.NDArray[numpy.float64], top: int) -> None: ...

    def stress(self, theta: numpy.typing.NDArray[numpy.float64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Evaluate S and S' at any angles."""

    def measure(self, theta: numpy.typing.NDArray[numpy.float64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Evaluate sqrt(1 + h'²) and its θ-derivative."""

    def half_plane_opening(self, theta: numpy.typing.NDArray[numpy.float64], side: int) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Evaluate C and dC/dθ of half-plane cracks that begin (side 0) or end (1) at θ.
        """

    def contact_length(self, gaps: numpy.typing.NDArray[numpy.float64]) -> float:
        """Integrate sqrt(1 + h'²) dθ over the patches between gaps."""

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

class EdgeLaw:
    """Law by which the edges move, with the tolerances of one problem."""

    @overload
    def __init__(self, *, critical: float, newton_tolerance: float, field_error: float, rest_step: float, longest_step: float, smallest: float, rough_rate: float, force_error: float, pinning: float) -> None: ...

    @overload
    def __init__(self, arg: EdgeLaw, /) -> None: ...

    @property
    def critical(self) -> float: ...

    @property
    def rest_step(self) -> float: ...

    @property
    def longest_step(self) -> float: ...

    @longest_step.setter
    def longest_step(self, arg: float, /) -> None: ...

    @property
    def smallest(self) -> float: ...

    @smallest.setter
    def smallest(self, arg: float, /) -> None: ...

    @property
    def pinning(self) -> float: ...

    @property
    def memory(self) -> NDArray[numpy.float64]:
        """Gaps at the last state."""

    @memory.setter
    def memory(self, arg: numpy.typing.NDArray[numpy.float64], /) -> None: ...

    def free_edges(self, gaps: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.int64]:
        """
        Find the edges that are not at their memory; all with one work of adhesion.
        """

    def critical_of(self, gaps: numpy.typing.NDArray[numpy.float64], opening: numpy.typing.NDArray[numpy.float64], panels: Panels) -> numpy.typing.NDArray[numpy.float64]:
        """Compute C_c at every edge with the opening C."""

    def critical_openings(self, theta: numpy.typing.NDArray[numpy.float64], panels: Panels) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Evaluate C_c of edges that advance, and its θ-derivative."""

def shortest_length(gaps: numpy.typing.NDArray[numpy.float64]) -> float:
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
    def opening(self) -> numpy.typing.NDArray[numpy.float64]:
        """C at each edge."""

    @property
    def scaled_opening(self) -> numpy.typing.NDArray[numpy.float64]:
        """f: the openings over sqrt(1-η²), at all nodes."""

    @property
    def orders(self) -> numpy.typing.NDArray[numpy.int64]: ...

    @property
    def offset(self) -> numpy.typing.NDArray[numpy.int64]: ...

    @property
    def theta(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def weight(self) -> numpy.typing.NDArray[numpy.float64]:
        """X."""

    @property
    def load(self) -> numpy.typing.NDArray[numpy.float64]:
        """S~."""

    def block(self, k: int) -> NDArray[numpy.float64]:
        """Diagonal block of B + G of a gap."""

    def edge_openings(self, scaled: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
        """Evaluate C at each edge from f at all nodes, of all modes."""

    def openings_by_prescribed(self) -> numpy.typing.NDArray[numpy.float64]:
        """∂C/∂d at fixed edges."""

    def fine_opening(self, k: int, per_wave: float) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Evaluate θ, T and the weight of ∫ T g dθ over T of a gap at fine nodes, and b_n.
        """

    def sum_modes(self, k: int, theta: numpy.typing.NDArray[numpy.float64], modes: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
        """Sum b_n sin((n+1)t), cos t = η(θ), in gap k."""

    def refine_opening(self, k: int, modes: numpy.typing.NDArray[numpy.float64], factor: int) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        Evaluate θ and T of gap k at about `factor` times as many nodes as modes.
        """

    def work_of_gaps(self) -> float:
        """Integrate S_full T dθ over the gaps."""

def sum_pull(theta: numpy.typing.NDArray[numpy.float64], sine: numpy.typing.NDArray[numpy.float64], cosine: numpy.typing.NDArray[numpy.float64], weight: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """Sum weight_j / sin²((θ-φ_j)/2) over j, with sine and cosine of φ_j/2."""

def solve_field(gaps: numpy.typing.NDArray[numpy.float64], prescribed: float, model: FieldModel, orders: numpy.typing.NDArray[numpy.int64] | None = None) -> Field:
    """
    Solve the field of gaps, shape (L, 2); `orders` are those of their rules.
    """

class ResponseSolution:
    """All edges as a linear response has them at a prescribed value."""

    @property
    def motion(self) -> numpy.typing.NDArray[numpy.float64]: ...

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
    def rate(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def pressure(self) -> float: ...

    @property
    def separation(self) -> float: ...

    @property
    def slope(self) -> float: ...

    @property
    def pinned_share(self) -> numpy.typing.NDArray[numpy.float64]:
        """Place of C of pinned edges between both critical openings."""

    @property
    def pinned_rate(self) -> numpy.typing.NDArray[numpy.float64]:
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

    def __init__(self, start: numpy.typing.NDArray[numpy.float64]) -> None: ...

class LinearResponse:
    """Linear response of all gaps and their edges."""

    @property
    def gap_count(self) -> int: ...

    @property
    def orders(self) -> numpy.typing.NDArray[numpy.int64]: ...

    @property
    def opening(self) -> numpy.typing.NDArray[numpy.float64]:
        """C of every edge in its reference."""

    @property
    def potential(self) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Potentials of the last solution without p, and with a unit of p."""

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""

    @property
    def charges(self) -> numpy.typing.NDArray[numpy.int64]:
        """Number of charges of every run of the tree of gaps."""

    def update(self, gaps: numpy.typing.NDArray[numpy.float64], prescribed: float, least: numpy.typing.NDArray[numpy.int64] | None, law: EdgeLaw, model: FieldModel) -> LinearResponse | None:
        """Set up a response of gaps of which most are those of this one."""

    def count_unknown(self, gaps: numpy.typing.NDArray[numpy.float64], law: EdgeLaw, model: FieldModel) -> int:
        """Count the gaps that `update` would not take over."""

    def settle(self, gaps: numpy.typing.NDArray[numpy.float64], prescribed: float, law: EdgeLaw, model: FieldModel) -> bool:
        """Renew the response for a known equilibrium; False if it is outgrown."""

    def solve(self, prescribed: float, law: EdgeLaw, model: FieldModel) -> ResponseSolution: ...

    def solve_separately(self, gaps: numpy.typing.NDArray[numpy.float64], pressure: float, prescribed: float, model: FieldModel) -> Field:
        """Solve every gap by itself in the potential of the last solution."""

    def tangent_between(self, gaps: numpy.typing.NDArray[numpy.float64], edges: numpy.typing.NDArray[numpy.int64], prescribed: float, law: EdgeLaw, model: FieldModel) -> NDArray[numpy.float64]:
        """
        Compute ∂(C_e - C_c)/∂n_f between some edges of these gaps.

        All others follow, but those at their memory, which are pinned.
        """

    def find_equilibrium(self, gaps: numpy.typing.NDArray[numpy.float64], prescribed: float, reach: float, strict: bool, law: EdgeLaw, model: FieldModel) -> Equilibrium:
        """Find the equilibrium next to these gaps by Newton's iteration."""

    def descend(self, gaps: numpy.typing.NDArray[numpy.float64], prescribed: float, most: int, equal_speeds: bool, running: Running, law: EdgeLaw, model: FieldModel) -> Descent:
        """Descend in energy until an event."""

def set_up_response(gaps: numpy.typing.NDArray[numpy.float64], prescribed: float, least: numpy.typing.NDArray[numpy.int64] | None, law: EdgeLaw, model: FieldModel) -> LinearResponse | None:
    """
    Solve the field of these gaps, and linearise about it; None if they have none.
    """

class SearchLengths:
    """Lengths of a search for touches, in 1/q0."""

    def __init__(self, *, wave: float, closing_per_motion: float, surface: float, narrowest: float, widest: float) -> None: ...

    def seed_widths(self, curvature: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
        """Compute the widths of seeds at touches with these curvatures."""

    def clearances(self, opening: numpy.typing.NDArray[numpy.float64], curvature: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
        """
        Compute the opening left at minima before a seed is put; not positive at a touch.
        """

class SearchedGaps:
    """Gaps as they were when they were last searched; a copy has none."""

    def __init__(self) -> None: ...

    def __getstate__(self) -> int: ...

    def __setstate__(self, arg: int, /) -> None: ...

def search(field: Field, searched: SearchedGaps, lengths: SearchLengths) -> tuple[float, int, tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]], SearchedGaps]:
    """
    Find the least clearance of a field, searching only gaps that may have closed.

    Also returns the number of these gaps, their minima (positions, openings and curvatures), and the updated searched gaps.
    """

def clearance_left(field: Field, searched: SearchedGaps, lengths: SearchLengths) -> numpy.typing.NDArray[numpy.float64]:
    """Bound the clearance left in each gap from below."""

def least_clearances(field: Field, gaps: numpy.typing.NDArray[numpy.int64], lengths: SearchLengths) -> numpy.typing.NDArray[numpy.float64]:
    """Find the least clearance of some gaps."""

class TwoPoints:
    """Two points of a branch, `way` apart in d."""

    def __init__(self, gaps: numpy.typing.NDArray[numpy.float64], rate: numpy.typing.NDArray[numpy.float64], gaps_before: numpy.typing.NDArray[numpy.float64], rate_before: numpy.typing.NDArray[numpy.float64], way: float) -> None: ...

    def leading_edge(self) -> LeadingEdge:
        """Find the leading edge, and the fold ahead."""

    def other_fold(self, leading: int) -> OtherFold:
        """Find the nearest fold ahead that other gaps lead to."""

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

class OtherFold:
    """Fold that others lead to than the leading edge."""

    def __init__(self) -> None: ...

    @property
    def edge(self) -> int:
        """-1 for none."""

    @property
    def distance(self) -> float:
        """In d; infinite for none."""

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

def pair_runs(count: int) -> list[list[int]]:
    """
    Pair neighbouring runs of gaps, level by level: the halves of every run.
    """

def pair_again(known: Sequence[Sequence[int]], source: numpy.typing.NDArray[numpy.int64]) -> tuple[list[list[int]], numpy.typing.NDArray[numpy.int64]]:
    """Pair the runs of gaps most of which are those of known halves."""

def count_negative(h: numpy.typing.NDArray[numpy.float64], r: numpy.typing.NDArray[numpy.float64]) -> int:
    """Count the negative eigenvalues of [[h, 1], [1, r]]."""

def local_minima(theta: numpy.typing.NDArray[numpy.float64], opening: numpy.typing.NDArray[numpy.float64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """Find local minima where θ falls: position, value, its error."""

def on_new_tree(response: LinearResponse, prescribed: float, law: EdgeLaw, model: FieldModel) -> LinearResponse:
    """Solve a response on a tree that is built anew."""

class EdgeModel:
    """Model of the edge openings about solved edges."""

    def __init__(self, edges: numpy.typing.NDArray[numpy.int64], gaps: numpy.typing.NDArray[numpy.float64], residual: numpy.typing.NDArray[numpy.float64], tangent: numpy.typing.NDArray[numpy.float64], law: EdgeLaw, panels: Panels) -> None: ...

    @property
    def opening(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def own(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def coupling(self) -> NDArray[numpy.float64]: ...

    @property
    def forces(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def hessian(self) -> NDArray[numpy.float64]: ...

    def advance(self, step: numpy.typing.NDArray[numpy.float64]) -> None:
        """Move the edges outwards by these steps."""

    def flow(self, limit: numpy.typing.NDArray[numpy.float64], equal_speeds: bool, is_long: bool, strongest: float, law: EdgeLaw) -> ModelFlow: ...

class ModelFlow:
    """Flow through the model."""

    def __init__(self, motion: numpy.typing.NDArray[numpy.float64], opening: numpy.typing.NDArray[numpy.float64], lengths: numpy.typing.NDArray[numpy.float64], residuals: Sequence[numpy.typing.NDArray[numpy.float64]]) -> None: ...

    @property
    def motion(self) -> numpy.typing.NDArray[numpy.float64]: ...

    @property
    def lengths(self) -> numpy.typing.NDArray[numpy.float64]: ...

def implicit_step(hessian: numpy.typing.NDArray[numpy.float64], force: numpy.typing.NDArray[numpy.float64], longest: float, equal_speeds: bool) -> numpy.typing.NDArray[numpy.float64]:
    """Take a linearly implicit step."""

def distance_to_minimum(hessian: numpy.typing.NDArray[numpy.float64], force: numpy.typing.NDArray[numpy.float64]) -> float:
    """
    Compute the largest motion to the minimum of a quadratic model; infinite without one.
    """

def model_error(flow: ModelFlow, residual: numpy.typing.NDArray[numpy.float64], edges: numpy.typing.NDArray[numpy.int64], gaps: numpy.typing.NDArray[numpy.float64], law: EdgeLaw, panels: Panels) -> float: ...

def next_reach(before: float, length: float, error: float) -> float: ...
