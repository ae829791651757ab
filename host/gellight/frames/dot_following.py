"""Which marker dot is which: every dot of the untouched gel has a name, its number, and keeps it.

A frame's dark spots are given to the dots by where the dots were in the frame before. Where that does not fit, as after
a jump of more than half a pitch, the names are found anew in this one frame: the gel is bonded to its support, so its
displacement changes little from a dot to the next. From the largest part of the lattice whose dots are where they were,
names are passed on from neighbour to neighbour, to the dots that fit best first. A dot without a spot is not seen, and
the reason is told; its place is then a guess from its neighbours.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gellight.frames.dot_places import DARKNESS_SHARE, Spots, border_px, find_spots
from gellight.frames.shear import DotsSeen, Unseen

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Numbers = NDArray[np.intp]
NEIGHBOURS = 8  # of a dot in a square lattice, with the diagonals
_NEAR = 1.6
"""pitches from a dot to its neighbours"""
_FITS = 0.42
"""pitches that a spot may be from where a dot is expected"""
_REACHES = (0.42, 0.6)
"""the same where names are found anew: narrowly, and widely"""
_STILL = (0.25, 0.06)
"""pitches that a dot has moved at most since the frame before where its name is taken for sure: widely, and strictly"""
_STRETCH = 0.42
"""of the distance of two neighbours: more the gel between them does not stretch"""
_GROWTH = 0.5
"""of how much two neighbours differ, the next one differs from the nearer of them"""
_PARTS, _LEAST_PART = 4, 2
"""so many parts, of so many dots at least, are tried as the beginning of new names"""
_MOST_WALKED = 1500
"""dots that are named anew in one frame, all tries together: the camera waits for it"""
_CANDIDATES = 4
"""spots that a dot may choose from, the nearest ones"""
_SHARE_SEEN = 0.6
"""of the dots: with fewer nothing is said of the gel"""
_STRAY_SHARE = {True: 0.15, False: 0.05}
"""of the dots: more spots than that where no dot is expected are of another lattice; once the gel is known, before"""
_AT_REST = 0.15
"""pitches that half of the dots of an untouched gel are off at most"""
_OWN = "use its own calibration"
_DARK_GREY = 12.0
"""a gel that is darker shows no dots"""


class DotFollower:
    """Follows the dots of one gel from frame to frame; serves one thread."""

    def __init__(self, rest_px: Floats, diameter_px: float, darkness: float) -> None:
        """Begin with the (N, 2) places of the dots on the untouched gel, whose usual darkness is given (0 to 1)."""
        self.rest_px, self._diameter_px = rest_px, diameter_px
        self._least = DARKNESS_SHARE * darkness
        distance = np.hypot(*np.moveaxis(rest_px[:, None] - rest_px[None], 2, 0))
        np.fill_diagonal(distance, np.inf)
        self.pitch_px = float(np.median(distance.min(axis=1)))
        self._near = _neighbours(distance, self.pitch_px)
        self._beyond = _beyond(rest_px, self._near)
        self._moved = np.zeros_like(rest_px)
        """(N, 2) from `rest_px`, in the frame before"""
        self._known = False
        """whether these dots were seen at rest once: until then they may be those of another gel"""

    def follow(self, image: NDArray[np.uint8]) -> DotsSeen:
        """Return where the dots are in a (H, W, 3) picture."""
        spots, size_px = find_spots(image, self._diameter_px, self._least), (image.shape[1], image.shape[0])
        named = self._as_before(spots.places_px)
        if self._may_be_all(spots, size_px) and not self._fits(named, spots.places_px):
            named = self._anew(spots.places_px)
        return self._told(named, spots, size_px)

    def _as_before(self, spots: Floats) -> Numbers:
        """(N,) the spot of each dot, -1 for none: each other's nearest to where the dots were."""
        if not len(spots):
            return np.full(len(self.rest_px), -1)
        expected = self.rest_px + self._moved
        distance, nearest = cKDTree(spots).query(expected)
        each = cKDTree(expected).query(spots)[1]
        fits = (each[nearest] == np.arange(len(expected))) & (distance < _FITS * self.pitch_px)
        return np.where(fits, nearest, -1)

    def _fits(self, named: Numbers, spots: Floats) -> bool:
        """Whether no neighbours are torn apart and no spot lies beside a dot that has none."""
        seen = named >= 0
        moved = np.where(seen[:, None], spots[named] - self.rest_px, 0) if len(spots) else self._moved
        if (self._torn(moved) & seen[:, None] & seen[self._near] & (self._near >= 0)).any():
            return False
        missing, left = ~seen, np.setdiff1d(np.arange(len(spots)), named)
        if not (missing.any() and left.size):
            return True
        expected = self.rest_px[missing] + self._guessed(moved, seen)[missing]
        return bool((cKDTree(spots[left]).query(expected)[0] > _FITS * self.pitch_px).all())

    def _torn(self, moved: Floats) -> Bools:
        """(N, NEIGHBOURS) whether a dot has moved against its neighbour farther than the gel stretches."""
        against = np.hypot(*np.moveaxis(moved[:, None] - moved[self._near], 2, 0))
        apart = np.hypot(*np.moveaxis(self.rest_px[:, None] - self.rest_px[self._near], 2, 0))
        return np.asarray(against > _STRETCH * apart)

    def _guessed(self, moved: Floats, seen: Bools) -> Floats:
        """(N, 2) the mean displacement of the seen neighbours; where there are none, of all."""
        use = (seen[self._near] & (self._near >= 0)).astype(np.float64)
        count = use.sum(axis=1)
        mean = (moved[self._near] * use[..., None]).sum(axis=1) / np.maximum(count, 1)[:, None]
        of_all = moved[seen].mean(axis=0) if seen.any() else np.zeros(2)
        return np.where((count > 0)[:, None], mean, of_all)

    def _anew(self, spots: Floats) -> Numbers:
        """(N,) the spot of each dot, named from neighbour to neighbour.

        It begins with each large part whose dots are where they were; the first names that fit and leave nothing
        unnamed are taken, and where there are none those that tear the gel least.
        """
        walked, left = [], _MOST_WALKED
        for named, reach in self._beginnings(spots):
            walk = _Walk(self.rest_px, self._near, self._beyond, spots, reach * self.pitch_px)
            walked.append(walk.from_named(named))
            left -= len(named)
            given = int((walked[-1] >= 0).sum())
            if left <= 0 or (given == min(len(named), len(spots)) and self._fits(walked[-1], spots)):
                break
        return min(walked, key=lambda names: self._misfit(names, spots), default=np.full(len(self.rest_px), -1))

    def _beginnings(self, spots: Floats) -> Iterator[tuple[Numbers, float]]:
        """Yield (N,) spots of the dots of each part, and how far in pitches the others are looked for from there."""
        named = self._as_before(spots)
        moved = np.where((named >= 0)[:, None], spots[named] - self.rest_px, 0)
        step, torn = np.hypot(*(moved - self._moved).T) / self.pitch_px, self._torn(moved)
        for still in _STILL:
            for part in self._parts((named >= 0) & (step < still), torn):
                for reach in _REACHES:
                    yield np.where(part, named, -1), reach

    def _misfit(self, named: Numbers, spots: Floats) -> float:
        """How badly names fit: the dots without a spot, and how unevenly the gel moves."""
        seen = named >= 0
        moved = np.where(seen[:, None], spots[named] - self.rest_px, 0)
        pairs = seen[:, None] & seen[self._near] & (self._near >= 0)
        uneven = (np.square(moved[:, None] - moved[self._near]).sum(axis=2) * pairs).sum()
        return float((~seen).sum() + uneven / self.pitch_px**2 / NEIGHBOURS)

    def _parts(self, dots: Bools, torn: Bools) -> list[Bools]:
        """(N,) the largest sets of `dots` that hang together by neighbours that are not torn apart."""
        joined = dots[:, None] & dots[self._near] & (self._near >= 0) & ~torn
        links = np.nonzero(joined)[0], self._near[joined]
        label = connected_components(coo_array((np.ones(len(links[0])), links), shape=(len(dots), len(dots))))[1]
        sizes = np.bincount(label[dots], minlength=1)
        largest = np.argsort(-sizes, kind="stable")[:_PARTS]
        return [dots & (label == one) for one in largest if sizes[one] >= _LEAST_PART]

    def _told(self, named: Numbers, spots: Spots, size_px: tuple[int, int]) -> DotsSeen:
        seen, places = named >= 0, spots.places_px
        moved = np.where(seen[:, None], places[named] - self.rest_px, 0) if len(places) else self._moved.copy()
        moved = np.where(seen[:, None], moved, self._guessed(moved, seen))
        reasons = self._reasons(seen, moved, spots, size_px)
        problem = self._problem(named, spots, size_px) or self._unlike(moved, seen)
        if not problem:
            self._moved, self._known = moved, True
        return DotsSeen(rest_px=self.rest_px, places_px=self.rest_px + moved, reasons=reasons, problem=problem)

    def _reasons(self, seen: Bools, moved: Floats, spots: Spots, size_px: tuple[int, int]) -> NDArray[np.uint8]:
        places = self.rest_px + moved
        reasons = np.where(seen, Unseen.SEEN, Unseen.MISSING)
        border = border_px(self._diameter_px)
        beyond = ((places < border) | (places > np.array(size_px) - 1 - border)).any(axis=1)
        reasons[~seen & beyond] = Unseen.BEYOND_VIEW
        if spots.brightness_grey < _DARK_GREY:
            reasons[~seen] = Unseen.DARK
        return reasons.astype(np.uint8)

    def _problem(self, named: Numbers, spots: Spots, size_px: tuple[int, int]) -> str:
        """Return why nothing can be said by the dots; empty where it can."""
        count, found, seen = len(named), len(spots.places_px), int((named >= 0).sum())
        if spots.brightness_grey < _DARK_GREY:
            return f"the gel is too dark ({spots.brightness_grey:.0f} of 255 grey levels) to see its marker dots"
        left = np.setdiff1d(np.arange(found), named)
        strays = int(self._inner(spots, size_px)[left].sum())
        if seen < _SHARE_SEEN * count <= found or strays > _STRAY_SHARE[self._known] * count:
            return (
                f"{found} marker dots are seen, of which {seen} are where the calibration has its {count}: this is "
                f"another gel, or the picture is turned; {_OWN}"
            )
        if seen < _SHARE_SEEN * count:
            return (
                f"{seen} of {count} marker dots are seen: they have come off, are hidden, or this gel has none; clean "
                "the gel, or calibrate it anew"
            )
        return ""

    def _inner(self, spots: Spots, size_px: tuple[int, int]) -> Bools:
        """(M,) whether a spot is not at the border, where dots come in that the untouched gel did not show."""
        edge_px = np.minimum(spots.places_px, np.array(size_px) - 1 - spots.places_px).min(axis=1)
        return np.asarray(edge_px > 0.6 * self.pitch_px)

    def _may_be_all(self, spots: Spots, size_px: tuple[int, int]) -> bool:
        """Whether some names may leave the frame without a problem: light, spots enough, and not far too many."""
        count, found = len(self.rest_px), len(spots.places_px)
        strays = int(self._inner(spots, size_px).sum()) - count
        lit = spots.brightness_grey >= _DARK_GREY
        return lit and found >= _SHARE_SEEN * count and strays <= _STRAY_SHARE[self._known] * count

    def _unlike(self, moved: Floats, seen: Bools) -> str:
        """Return why these may be the dots of another gel; empty once they were seen at rest."""
        usual = float(np.median(np.hypot(*moved[seen].T))) / self.pitch_px
        if self._known or usual < _AT_REST:
            return ""
        return (
            f"the marker dots are not where the calibration has them (in the median by {usual:.2f} of their distance): "
            f"take everything off the gel; if that does not help, this is another gel, and {_OWN}"
        )


class _Walk:
    """Gives names from neighbour to neighbour."""

    def __init__(self, rest: Floats, near: Numbers, beyond: Numbers, spots: Floats, reach: float) -> None:
        self._rest, self._near, self._beyond, self._spots, self._reach = rest, near, beyond, spots, reach
        self._tree = cKDTree(spots)

    def from_named(self, named: Numbers) -> Numbers:
        """Return (N,) spots by dot, -1 for none, of which some are given."""
        named = named.copy()
        free = np.ones(len(self._spots) + 1, bool)
        free[named[named >= 0]] = free[-1] = False
        while True:
            dots, spots = self._best(named, free)
            if not len(dots):
                return named
            named[dots], free[spots] = spots, False

    def _best(self, named: Numbers, free: Bools) -> tuple[Numbers, Numbers]:
        """Return the better half of the unnamed dots that fit a free spot beside named ones, and their spots."""
        known = (named >= 0)[self._near] & (self._near >= 0)
        ask = np.flatnonzero((named < 0) & known.any(axis=1))
        if not ask.size:
            return ask, ask
        expected = self._rest[ask] + self._carried_on(ask, named, known[ask])
        distance, spots = self._tree.query(expected, _CANDIDATES, distance_upper_bound=self._reach)
        chosen = np.where(free[spots], distance, np.inf).argmin(axis=1)[:, None]
        distance, spots = (np.take_along_axis(of_all, chosen, axis=1)[:, 0] for of_all in (distance, spots))
        # Many named neighbours are worth some distance: what they say together is surer.
        cost = np.where(free[spots], distance - 0.05 * self._reach * known[ask].sum(axis=1), np.inf)
        order = np.argsort(cost, kind="stable")[: (int(np.isfinite(cost).sum()) + 1) // 2]
        order = order[np.unique(spots[order], return_index=True)[1]]
        return ask[order], spots[order]

    def _carried_on(self, dots: Numbers, named: Numbers, known: Bools) -> Floats:
        """(n, 2) displacement of dots, as their named neighbours have it and as it grows from the dots behind these."""
        moved = np.where((named >= 0)[:, None], self._spots[named] - self._rest, 0)
        near, behind = moved[self._near[dots]], self._beyond[dots]
        grows = (behind >= 0) & (named[behind] >= 0)
        near = near + _GROWTH * np.where(grows[..., None], near - moved[behind], 0)
        return np.asarray((near * known[..., None]).sum(axis=1) / known.sum(axis=1)[:, None])


def _beyond(rest: Floats, near: Numbers) -> Numbers:
    """(N, NEIGHBOURS) the dot that lies as far behind a neighbour as this is away, -1 where there is none."""
    distance, nearest = cKDTree(rest).query(2 * rest[near] - rest[:, None])
    apart = np.hypot(*np.moveaxis(rest[near] - rest[:, None], 2, 0))
    return np.where((near >= 0) & (distance < 0.3 * apart), nearest, -1)


def _neighbours(distance: Floats, pitch_px: float) -> Numbers:
    """(N, NEIGHBOURS) numbers of the nearest dots, -1 beyond `_NEAR` pitches."""
    order = np.argsort(distance, axis=1)[:, :NEIGHBOURS]
    order = np.pad(order, ((0, 0), (0, NEIGHBOURS - order.shape[1])), constant_values=-1)
    far = np.take_along_axis(distance, order, axis=1) > _NEAR * pitch_px
    return np.where(far | (order < 0), -1, order)
