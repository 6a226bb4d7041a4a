"""Regressions that predict what a step changes, and the choice among them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from acl_gym.envs.learned.expansion import Certainty, Expansion, Terms
from acl_gym.envs.learned.gaussian_process import (
    MOST_POINTS,
    Posterior,
    Scales,
    certainty_of,
    search_scales,
)
from acl_gym.envs.learned.line import Output, add_leverage, add_lines
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

LEAST_STEPS = 5
"""Steps without which nothing is fitted."""

AGAIN = 1.5
"""How many times as many data make a new search for scales worth while."""

GOOD = 0.05
"""The error, relative to the deviation, below which no other kind is tried."""

N_FOLDS = 5
BLOCK = 10
"""Steps of a run that stay together in cross-validation, since neighbours are alike."""

N_RANDOM = 512
"""Random features."""

ENOUGH_FOR_TREES = 300
"""Steps below which trees are not tried."""

KINDS = (
    "gaussian process",
    "random features",
    "nearest neighbours",
    "gradient boosting",
)


class Regression(ABC):
    """Predicts some outputs from features.

    Attributes:
        name: of its kind.
        errors: root mean square errors of the outputs in cross-validation, in units of
            their deviations, `(n_outputs,)`: 0 is perfect, 1 is no better than the mean.
        n_members: 1 for the mean, and how many others there are beside it.
    """

    name: str
    errors: FloatArray
    n_members: int

    @abstractmethod
    def mean(self, rows: FloatArray) -> FloatArray:
        """Predict `(n, n_outputs)` from features `(n, n_features)`."""

    @abstractmethod
    def of_members(self, rows: FloatArray, members: IntArray) -> FloatArray:
        """The same, each row from a member, 0 to `n_members` - 1, 0 being the mean."""


class SumOfTerms(Regression):
    """A Gaussian process or random features, evaluated by this package's kernel."""

    def __init__(self, name: str, errors: list[float], outputs: list[Terms]) -> None:
        self.name, self.errors = name, np.array(errors)
        self._expansion = Expansion.of(outputs)
        self.n_members = self._expansion.n_members

    def mean(self, rows: FloatArray) -> FloatArray:
        """See `Regression`."""
        return self._expansion.mean(rows)

    def of_members(self, rows: FloatArray, members: IntArray) -> FloatArray:
        """See `Regression`."""
        return self._expansion.of_members(rows, members)


class OfLibrary(Regression):
    """Anything with scikit-learn's `fit` and `predict`, once for each output.

    Its other members are those of cross-validation, which know four fifths of the data
    each.
    """

    def __init__(self, name: str, make: Callable[[], Any], data: list[Output]) -> None:
        self.name = name
        self._members = [
            [each.estimator(make, each.every)] for each in data
        ]  # of each output
        errors = []
        for members, each in zip(self._members, data, strict=True):
            missed = np.empty(len(each.rows))
            for fold in range(N_FOLDS):
                out = each.folds == fold
                members.append(each.estimator(make, ~out))
                if out.any():
                    found = _predicted(members[-1], each.rows[out])
                    missed[out] = found - each.targets[out]
            errors.append(each.relative(missed))
        self.errors = np.array(errors)
        self.n_members = 1 + N_FOLDS

    def mean(self, rows: FloatArray) -> FloatArray:
        """See `Regression`."""
        return self._of(0, rows)

    def of_members(self, rows: FloatArray, members: IntArray) -> FloatArray:
        """See `Regression`."""
        found = np.empty((len(rows), len(self._members)))
        for member in np.unique(members):
            mine = members == member
            found[mine] = self._of(int(member), rows[mine])
        return found

    def _of(self, member: int, rows: FloatArray) -> FloatArray:
        columns = [_predicted(each[member], rows) for each in self._members]
        return np.stack(columns, axis=1)


def _predicted(estimator: Any, rows: FloatArray) -> FloatArray:
    """What an estimator of any author predicts, `(n,)`, checked.

    Raises:
        ValueError: it predicts something else than a finite number for each row.
    """
    found = validation.as_array(estimator.predict(rows))
    if found is not None and found.shape == (len(rows), 1):
        found = found[:, 0]
    good = (
        found is not None
        and found.shape == (len(rows),)
        and found.dtype.kind in "iuf"
        and bool(np.isfinite(found).all())
    )
    if found is None or not good:
        raise ValueError(
            f"predict of the regressor {type(estimator).__name__} must return a finite "
            f"number for each of {len(rows)} rows, got {validation.shown(found)}."
        )
    return found.astype(np.float64)


class Fit:
    """A regression, and what it knows where.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n, n_outputs)`, of about unit size.
        kind: one of `KINDS`, "auto", or an object with `fit` and `predict`.
        usable: which targets are to be fitted, `(n, n_outputs)`; None: all.
        n_draws: draws from the posterior beside the mean.
        seed: of the draws.
        begin: the fit of fewer data. Scales are searched for and kinds compared anew
            only where there are `AGAIN` times as many data as at the last time; until
            then "auto" takes the kind of that fit.

    Attributes:
        regression: what predicts.
        tried: the mean error of each kind that was tried.
        scales: of each output.
        searched_at: how many data there were when these were searched for.
    """

    def __init__(
        self,
        rows: FloatArray,
        targets: FloatArray,
        kind: Any,
        *,
        usable: BoolArray | None = None,
        n_draws: int = 0,
        seed: int = 0,
        begin: Fit | None = None,
    ) -> None:
        # Before threads are limited, which reaches only libraries that are loaded.
        import sklearn.ensemble
        import sklearn.neighbors  # noqa: F401
        from threadpoolctl import threadpool_limits

        folds = folds_of(len(rows))
        outputs = []
        for number in range(targets.shape[1]):
            good = np.ones(len(rows), np.bool_)
            if usable is not None and usable[:, number].sum() >= LEAST_STEPS:
                good = usable[:, number]
            outputs.append(Output(rows[good], targets[good, number], folds[good]))
        # Threads of their own would wait for each other on a busy machine, and add up
        # in another order.
        with threadpool_limits(1):
            self._choose(outputs, kind, n_draws, seed, begin)

    def _choose(
        self,
        outputs: list[Output],
        kind: Any,
        n_draws: int,
        seed: int,
        begin: Fit | None,
    ) -> None:
        self.regression: Regression
        self.scales: list[Scales]
        self.searched_at: int
        count, n_features = outputs[0].every.size, outputs[0].rows.shape[1]
        if begin is not None and (
            len(begin.scales) != len(outputs)
            or begin.scales[0].lengths.size != n_features
        ):
            begin = None
        if begin is not None and count < AGAIN * begin.searched_at:
            self.scales, self.searched_at = begin.scales, begin.searched_at
            known = begin.regression.name
            again = (
                kind == "auto" and known in KINDS
            )  # else it is an object of the user's
            kinds = [known] if again else _candidates(kind, count)
        else:
            self.searched_at = count
            self.scales = [
                search_scales(
                    each.rows,
                    each.targets,
                    [] if begin is None else [begin.scales[number]],
                )
                for number, each in enumerate(outputs)
            ]
            kinds = _candidates(kind, count)
        self._lines = np.array([each.line for each in outputs])
        self._scale = np.array([each.scale for each in outputs])
        self._unsure = np.array([each.unsure for each in outputs])
        self._certainty: Certainty = certainty_of(
            [each.rows for each in outputs], self.scales
        )
        self.tried: dict[str, float] = {}
        least = np.inf
        for each in kinds:
            found = _fitted(each, outputs, self.scales, n_draws, seed)
            error = float(np.mean(np.minimum(found.errors, 2.0)))
            self.tried[found.name] = error
            if error < least or least == np.inf:
                self.regression, least = found, error
            if least < GOOD:
                break  # no other kind could be worth its time

    def mean(self, rows: FloatArray) -> FloatArray:
        """Predict `(n, n_outputs)` from features `(n, n_features)`."""
        return self._with_lines(rows, self.regression.mean(rows))

    def of_members(self, rows: FloatArray, members: IntArray) -> FloatArray:
        """The same from the member of each row, see `Regression.of_members`."""
        return self._with_lines(rows, self.regression.of_members(rows, members))

    def deviation(self, rows: FloatArray) -> FloatArray:
        """How uncertain each output is, `(n, n_outputs)`: its line and the rest together.

        What the line leaves unexplained counts as its noise. So a point far from the
        data is uncertain where the line leaves much, or was fitted to few data.
        """
        found = self._certainty.deviation(rows)
        add_leverage(rows, self._unsure, self._scale, found)
        return found

    def _with_lines(self, rows: FloatArray, left: FloatArray) -> FloatArray:
        add_lines(rows, self._lines, self._scale, left)
        return left


def folds_of(count: int) -> IntArray:
    """The fold of each step, blocks of `BLOCK` steps staying together."""
    blocks = np.arange(count) // BLOCK
    if blocks[-1] + 1 < N_FOLDS:
        blocks = np.arange(count)
    return np.asarray(blocks % N_FOLDS)


def checked_kind(kind: Any) -> Any:
    """Return `regressor` if it is a kind of regression.

    Raises:
        ValueError: it is text, but no kind.
        TypeError: it has no `fit` and `predict`.
    """
    if isinstance(kind, str):
        return validation.one_of("regressor", kind, ("auto", *KINDS))
    methods = all(callable(getattr(kind, name, None)) for name in ("fit", "predict"))
    if isinstance(kind, type) or not methods:
        raise TypeError(
            "regressor must be a name or an object with fit(X, y) and predict(X), got "
            f"{validation.shown(kind)}; of a class pass an instance."
        )
    return kind


def _candidates(kind: Any, count: int) -> list[Any]:
    if not isinstance(kind, str) or kind != "auto":
        return [kind]
    found = ["gaussian process"]
    if count > MOST_POINTS:
        found.append("random features")
    if count >= ENOUGH_FOR_TREES:
        found.append("gradient boosting")
    return [*found, "nearest neighbours"]


def _fitted(
    kind: Any, outputs: list[Output], scales: list[Scales], n_draws: int, seed: int
) -> Regression:
    if kind == "gaussian process":
        return _process(outputs, scales, n_draws, seed)
    if kind == "random features":
        return _waves(outputs, scales, n_draws, seed)
    name = kind if isinstance(kind, str) else type(kind).__name__
    return OfLibrary(name, _maker(kind), outputs)


def _maker(kind: Any) -> Callable[[], Any]:
    """A function that makes an estimator that is not fitted yet."""
    if kind == "nearest neighbours":
        from sklearn.neighbors import KNeighborsRegressor

        return lambda: KNeighborsRegressor(n_neighbors=3, weights="distance")
    if kind == "gradient boosting":
        from sklearn.ensemble import HistGradientBoostingRegressor

        return lambda: HistGradientBoostingRegressor(
            early_stopping=False, random_state=0
        )
    from sklearn.base import clone

    return lambda: clone(kind, safe=False)


def _process(
    outputs: list[Output], scales: list[Scales], n_draws: int, seed: int
) -> Regression:
    errors, terms, rng = [], [], np.random.default_rng(seed)
    for each, own in zip(outputs, scales, strict=True):
        posterior = Posterior(each.rows, each.targets, own)
        errors.append(each.relative(posterior.errors_left_out(each.folds)))
        terms.append(posterior.terms(n_draws, rng))
    return SumOfTerms(KINDS[0], errors, terms)


def _waves(
    outputs: list[Output], scales: list[Scales], n_draws: int, seed: int
) -> Regression:
    """Random features of the scales that were found, with ridge regression."""
    from sklearn.kernel_approximation import RBFSampler

    errors, terms, rng = [], [], np.random.default_rng(seed)
    for each, own in zip(outputs, scales, strict=True):
        # For exp(-gamma |a - b|^2) with lengths taken out beforehand.
        sampler = RBFSampler(
            gamma=0.5, n_components=N_RANDOM, random_state=seed % 2**32
        )
        features = sampler.fit_transform(each.rows / own.lengths)
        # A weight has the prior variance `amplitude`, the features being normalised.
        ridge = own.noise / own.amplitude + 1e-9
        missed = np.empty(len(features))
        for fold in np.unique(each.folds):
            out = each.folds == fold
            mean, _ = _ridge(features[~out], each.targets[~out], ridge)
            missed[out] = features[out] @ mean - each.targets[out]
        mean, factor = _ridge(features, each.targets, ridge)
        weights = [mean]
        for _ in range(n_draws):
            draw = np.linalg.solve(factor.T, rng.standard_normal(N_RANDOM))
            weights.append(mean + np.sqrt(own.noise) * draw)
        n_features = each.rows.shape[1]
        terms.append(
            Terms(
                1.0 / own.lengths,
                np.empty((n_features, 0)),
                np.empty((n_draws + 1, 0)),
                sampler.random_weights_,
                sampler.random_offset_,
                np.sqrt(2.0 / N_RANDOM) * np.array(weights),
            )
        )
        errors.append(each.relative(missed))
    return SumOfTerms(KINDS[1], errors, terms)


def _ridge(
    features: FloatArray, target: FloatArray, ridge: float
) -> tuple[FloatArray, FloatArray]:
    """Weights of ridge regression, and the Cholesky factor of its normal matrix."""
    from scipy.linalg import cho_solve

    normal = features.T @ features
    normal[np.diag_indices(len(normal))] += ridge
    factor = np.asarray(np.linalg.cholesky(normal))
    return np.asarray(cho_solve((factor, True), features.T @ target)), factor
