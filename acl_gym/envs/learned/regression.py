"""Regressions that predict what a step changes, and the choice among them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from acl_gym.envs.learned.expansion import Certainty, Expansion, padded
from acl_gym.envs.learned.gaussian_process import (
    MOST_POINTS,
    Posterior,
    Scales,
    certainty_of,
    search_scales,
)
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray

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

    def __init__(self, name: str, errors: FloatArray, expansion: Expansion) -> None:
        self.name, self.errors = name, errors
        self._expansion = expansion
        self.n_members = expansion.n_members

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

    def __init__(
        self,
        name: str,
        make: Callable[[], Any],
        rows: FloatArray,
        targets: FloatArray,
        folds: IntArray,
    ) -> None:
        self.name = name
        outputs = range(targets.shape[1])
        missed = np.empty(targets.shape)
        self._members = [[_fitted(make(), rows, targets[:, o]) for o in outputs]]
        for fold in np.unique(folds):
            out = folds == fold
            member = [_fitted(make(), rows[~out], targets[~out, o]) for o in outputs]
            missed[out] = self._of(member, rows[out]) - targets[out]
            self._members.append(member)
        self.errors = _relative(missed, targets)
        self.n_members = len(self._members)

    @staticmethod
    def _of(member: list[Any], rows: FloatArray) -> FloatArray:
        columns = [
            np.asarray(each.predict(rows), np.float64).ravel() for each in member
        ]
        return np.stack(columns, axis=1)

    def mean(self, rows: FloatArray) -> FloatArray:
        """See `Regression`."""
        return self._of(self._members[0], rows)

    def of_members(self, rows: FloatArray, members: IntArray) -> FloatArray:
        """See `Regression`."""
        found = np.empty((len(rows), len(self._members[0])))
        for member in np.unique(members):
            mine = members == member
            found[mine] = self._of(self._members[member], rows[mine])
        return found


class Fit:
    """A regression, what it knows where, and the scales with which a next fit begins.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n, n_outputs)`, of about unit size.
        kind: one of `KINDS`, "auto", or an object with `fit` and `predict`.
        n_draws: draws from the posterior beside the mean.
        seed: of the draws.
        begin: the fit of fewer data, to begin with.
        folds: the number of the fold of each row, `(n,)`.
    """

    def __init__(
        self,
        rows: FloatArray,
        targets: FloatArray,
        kind: Any,
        *,
        folds: IntArray,
        n_draws: int = 0,
        seed: int = 0,
        begin: Fit | None = None,
    ) -> None:
        from threadpoolctl import threadpool_limits

        # Threads of their own would wait for each other on a busy machine, and add up
        # in another order.
        with threadpool_limits(1):
            self._fit(rows, targets, kind, folds, n_draws, seed, begin)

    def _fit(
        self,
        rows: FloatArray,
        targets: FloatArray,
        kind: Any,
        folds: IntArray,
        n_draws: int,
        seed: int,
        begin: Fit | None,
    ) -> None:
        self.scales: list[Scales]
        same = begin is not None and begin.scales[0].lengths.size == rows.shape[1]
        self.scales = search_scales(
            rows, targets, begin.scales if begin is not None and same else None
        )
        self.certainty: Certainty = certainty_of(rows, self.scales)
        tried = []
        for name in _candidates(kind, len(rows)):
            if name == "gaussian process":
                tried.append(_process(rows, targets, self.scales, folds, n_draws, seed))
            elif name == "random features":
                tried.append(_waves(rows, targets, self.scales, folds, n_draws, seed))
            else:
                make = _maker(name)
                tried.append(OfLibrary(_named(name), make, rows, targets, folds))
        scores = [float(np.mean(np.minimum(each.errors, 2.0))) for each in tried]
        self.tried = dict(zip((each.name for each in tried), scores, strict=True))
        self.regression = tried[int(np.argmin(scores))]


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
    if not (
        callable(getattr(kind, "fit", None))
        and callable(getattr(kind, "predict", None))
    ):
        raise TypeError(
            "regressor must be a name or an object with fit(X, y) and predict(X), got "
            f"{validation.shown(kind)}."
        )
    return kind


def _candidates(kind: Any, count: int) -> list[Any]:
    if not isinstance(kind, str) or kind != "auto":
        return [kind]
    found = ["gaussian process", "nearest neighbours"]
    if count > MOST_POINTS:
        found.insert(1, "random features")
    if count >= ENOUGH_FOR_TREES:
        found.append("gradient boosting")
    return found


def _named(kind: Any) -> str:
    return kind if isinstance(kind, str) else type(kind).__name__


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


def _fitted(estimator: Any, rows: FloatArray, targets: FloatArray) -> Any:
    estimator.fit(rows, targets)
    return estimator


def _process(
    rows: FloatArray,
    targets: FloatArray,
    scales: list[Scales],
    folds: IntArray,
    n_draws: int,
    seed: int,
) -> Regression:
    posterior = Posterior(rows, targets, scales)
    errors = _relative(posterior.errors_left_out(folds), targets[posterior.kept])
    return SumOfTerms(KINDS[0], errors, posterior.expansion(n_draws, seed))


def _waves(
    rows: FloatArray,
    targets: FloatArray,
    scales: list[Scales],
    folds: IntArray,
    n_draws: int,
    seed: int,
) -> Regression:
    """Random features of the scales that were found, with ridge regression."""
    from sklearn.kernel_approximation import RBFSampler

    directions, phases, waves, missed = [], [], [], np.empty(targets.shape)
    rng = np.random.default_rng(seed)
    for output, each in enumerate(scales):
        # For exp(-gamma |a - b|^2) with lengths taken out beforehand.
        sampler = RBFSampler(gamma=0.5, n_components=N_RANDOM, random_state=seed)
        features = sampler.fit_transform(rows / each.lengths)
        # A weight has the prior variance `amplitude`, the features being normalised.
        ridge = each.noise / each.amplitude + 1e-9
        target = targets[:, output]
        for fold in np.unique(folds):
            out = folds == fold
            mean, _ = _ridge(features[~out], target[~out], ridge)
            missed[out, output] = features[out] @ mean - target[out]
        mean, factor = _ridge(features, target, ridge)
        weights = [mean]
        for _ in range(n_draws):
            draw = np.linalg.solve(factor.T, rng.standard_normal(N_RANDOM))
            weights.append(mean + np.sqrt(each.noise) * draw)
        directions.append(sampler.random_weights_)
        phases.append(sampler.random_offset_)
        waves.append(np.sqrt(2.0 / N_RANDOM) * np.array(weights))
    n_outputs, n_features = len(scales), rows.shape[1]
    expansion = Expansion(
        np.array([1.0 / each.lengths for each in scales]),
        np.empty((n_outputs, n_features, 0)),
        np.empty((n_draws + 1, n_outputs, 0)),
        padded(np.array(directions)),
        padded(np.array(phases)),
        padded(np.array(waves).transpose(1, 0, 2)),
    )
    return SumOfTerms(KINDS[1], _relative(missed, targets), expansion)


def _ridge(
    features: FloatArray, target: FloatArray, ridge: float
) -> tuple[FloatArray, FloatArray]:
    """Weights of ridge regression, and the Cholesky factor of its normal matrix."""
    from scipy.linalg import cho_solve

    normal = features.T @ features
    normal[np.diag_indices(len(normal))] += ridge
    factor = np.linalg.cholesky(normal)
    return np.asarray(cho_solve((factor, True), features.T @ target)), np.asarray(
        factor
    )


def _relative(missed: FloatArray, targets: FloatArray) -> FloatArray:
    deviation = targets.std(axis=0)
    return np.asarray(
        np.sqrt((missed**2).mean(axis=0)) / np.where(deviation > 0.0, deviation, 1.0)
    )
