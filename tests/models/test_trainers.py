"""The two trainers are one: the same loss, the same gradients, the same network after as many steps."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gelnet.numpy_trainer import NumpyTrainer, kept_units, loss_of_block, random_network
from gelnet.parameters import Floats, Parameters
from gelnet.recipes import RECIPES, Recipe
from gelnet.table import Table, checked
from gelnet.trainers import make_trainer
from tests.helpers.trainers import TRAINERS, rows_of_a_known_sensor

PAPER = replace(RECIPES["paper"], dropout=0.0)
DECAYING = replace(RECIPES["fine"], weight_decay=5.0)
"""so fast that nobody who forgets it ends at the same error"""
recipes = pytest.mark.parametrize(
    "recipe", [RECIPES["fast"], RECIPES["thorough"], DECAYING, PAPER], ids=["fast", "thorough", "fine", "paper"]
)


def pressed(per_image: int = 600) -> Table:
    rows = rows_of_a_known_sensor(10 * per_image, noise_grey=1.0)
    return checked(rows, np.repeat(np.arange(10), per_image), np.array([320, 240]))


def pair(recipe: Recipe, table: Table, width: int = 32) -> tuple[Any, NumpyTrainer]:
    by_torch: Any = make_trainer("torch", seed=1)
    by_numpy = NumpyTrainer(seed=1)
    by_torch.begin(table.rows[:, :5].copy(), table.rows[:, 5:].copy(), width=width, recipe=recipe)
    by_numpy.begin_with(by_torch.parameters(), recipe)
    return by_torch, by_numpy


def torch_derivative(trainer: Any, pixels: Floats, gradient: Floats) -> tuple[float, Floats]:
    """The loss, and its derivative in the order of the layers."""
    import torch

    loss = trainer.loss(pixels, gradient)
    wanted = [
        parameter for layer in (*trainer.network.hidden, trainer.network.output) for parameter in layer.parameters()
    ]
    derivative = torch.autograd.grad(loss, wanted)
    return float(loss.detach()), np.concatenate([part.numpy().ravel() for part in derivative])


def flat(network: Parameters) -> Floats:
    return np.concatenate([part.ravel() for layer in network.layers for part in layer])


@pytest.mark.parametrize("name", RECIPES)
@pytest.mark.parametrize("trainer", TRAINERS)
def test_every_recipe_subtracts_the_answer_to_an_unchanged_pixel_as_the_host_does(trainer: str, name: str) -> None:
    """So an unchanged pixel is flat whatever the weights: its loss is the least there is."""
    table, made = pressed(), make_trainer(trainer, seed=0)
    recipe = replace(RECIPES[name], dropout=0.0)
    made.begin(table.pixels, table.gradient, width=8, recipe=recipe)
    unchanged = table.pixels[:300] * np.array([0, 0, 0, 1, 1], np.float32)
    assert np.abs(made.answer(unchanged)).max() > 0.01
    least = {"gradient": 0.0, "normal": 1e-3}[recipe.loss]
    assert made.step(unchanged, np.zeros((300, 2), np.float32), 0.0) == pytest.approx(least, rel=1e-4, abs=1e-7)
    assert made.step(unchanged, np.full((300, 2), 0.1, np.float32), 0.0) > 0.05


@recipes
def test_the_derivative_is_that_of_the_loss(recipe: Recipe) -> None:
    """By differences, in double precision: it holds without torch."""
    table = pressed(per_image=4)
    single = random_network(table.rows[:, :5], table.rows[:, 5:], width=3, random=np.random.default_rng(0))
    layers = tuple(type(layer)(*(part.astype(np.float64) for part in layer)) for layer in single.layers)
    network = replace(single, layers=layers, centre=single.centre.astype(float), scale=single.scale.astype(float))
    pixels, gradient = table.rows[:, :5].T.astype(float), table.rows[:, 5:].T.astype(float)
    _, derivative = loss_of_block(network, pixels, gradient, recipe)
    position = 0
    for layer in layers:
        for part in layer:
            for index in np.ndindex(part.shape):
                losses, kept = [], part[index]
                for step in (1e-5, -1e-5):
                    part[index] = kept + step
                    losses.append(loss_of_block(network, pixels, gradient, recipe)[0])
                part[index] = kept
                assert derivative[position] == pytest.approx((losses[0] - losses[1]) / 2e-5, rel=1e-4, abs=1e-4)
                position += 1
    assert position == len(derivative)


@pytest.mark.nightly
@recipes
def test_the_same_batches_give_the_same_network(recipe: Recipe) -> None:
    table = pressed()
    by_torch, by_numpy = pair(recipe, table)
    random = np.random.default_rng(3)
    for step in range(20):
        batch = table.rows[random.integers(0, len(table.rows), 600)]  # two whole blocks of NumPy's and a part
        rate = recipe.learning_rate * (1 - step / 20)
        losses = [trainer.step(batch[:, :5].copy(), batch[:, 5:].copy(), rate) for trainer in (by_torch, by_numpy)]
        assert losses[1] == pytest.approx(losses[0], rel=1e-5)
    np.testing.assert_allclose(flat(by_numpy.parameters()), flat(by_torch.parameters()), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(by_numpy.answer(table.rows[:, :5]), by_torch.answer(table.rows[:, :5]), atol=1e-4)
    assert not np.allclose(flat(by_numpy.parameters()), flat(pair(recipe, table)[1].parameters()), atol=10 * rate)


@pytest.mark.parametrize("trainer", TRAINERS)
def test_a_width_of_32_has_3426_parameters_drawn_as_torch_draws_them(trainer: str) -> None:
    table, made = pressed(), make_trainer(trainer, seed=0)
    made.begin(table.pixels, table.gradient, width=32, recipe=RECIPES["fast"])
    drawn = made.parameters()
    assert len(flat(drawn)) == 3426
    np.testing.assert_allclose(drawn.centre, table.pixels.mean(axis=0), rtol=1e-4)
    np.testing.assert_allclose(drawn.scale, table.pixels.std(axis=0), rtol=1e-3)
    assert drawn.steepest_rad == pytest.approx(0.825, abs=0.002), "5 % above 45 degrees"
    for layer, (outputs, inputs) in zip(drawn.layers, [(32, 5), *[(32, 32)] * 3, (2, 32)], strict=True):
        bound = 1 / np.sqrt(inputs)
        assert (layer.weight.shape, layer.bias.shape) == ((outputs, inputs), (outputs,))
        assert np.abs(layer.bias).max() <= bound
        assert 0.95 * bound < np.abs(layer.weight).max() <= bound
        assert layer.weight.std() == pytest.approx(bound / np.sqrt(3), rel=0.15)


def begun(trainer: str, pixels: Floats, gradient: Floats) -> Any:
    made = make_trainer(trainer, seed=0)
    made.begin(pixels.astype(np.float32), gradient.astype(np.float32), width=4, recipe=RECIPES["fast"])
    return made


@pytest.mark.parametrize("trainer", TRAINERS)
@pytest.mark.parametrize(("steepest", "bound"), [(0.09, 0.1), (0.1, 0.1047), (5.0, 1.442), (10.0, 1.5), (1e9, 1.5)])
def test_the_bound_leaves_room_for_the_steepest_training_slope(trainer: str, steepest: float, bound: float) -> None:
    made = begun(trainer, pressed(per_image=2).pixels, np.full((20, 2), -steepest))
    assert made.parameters().steepest_rad == pytest.approx(bound, abs=1e-3)


@pytest.mark.parametrize("trainer", TRAINERS)
@pytest.mark.parametrize(("spread", "scale"), [(0.0, 1.0), (5e-7, 1.0), (2e-6, 2e-6)])
def test_a_column_that_hardly_changes_is_not_divided_by_its_spread(trainer: str, spread: float, scale: float) -> None:
    made = begun(trainer, np.tile(np.array([[-1.0], [1.0]]), (500, 5)) * spread, np.zeros((1000, 2)))
    assert made.parameters().scale == pytest.approx(scale, rel=1e-2)


@pytest.mark.parametrize("trainer", TRAINERS)
def test_units_of_the_input_do_not_matter_because_the_range_is_inside(trainer: str) -> None:
    table = pressed(per_image=20)
    others = table.pixels * np.array([3.0, 0.5, 10.0, 2.0, 7.0]) + np.array([5.0, -20.0, 0.0, 100.0, 3.0])
    networks = [begun(trainer, pixels, table.gradient).parameters() for pixels in (table.pixels, others)]
    inside = [(rows - one.centre) / one.scale for rows, one in zip((table.pixels, others), networks, strict=True)]
    np.testing.assert_allclose(*inside, atol=1e-4)
    np.testing.assert_array_equal(*(flat(one) for one in networks))


def test_one_row_has_no_spread_and_no_input_makes_a_slope_steeper_than_the_bound() -> None:
    table = pressed(per_image=20)
    assert (begun("numpy", table.pixels[:1], table.gradient[:1]).parameters().scale == 1).all()
    made = begun("numpy", table.pixels, table.gradient)
    drawn = made.parameters()
    output = drawn.layers[-1]
    steep = replace(drawn, layers=(*drawn.layers[:-1], type(output)(1e6 * output.weight, output.bias)))
    made.begin_with(steep, RECIPES["fast"])
    slopes = made.answer(table.pixels * np.float32(1e4))
    assert np.isfinite(slopes).all()
    assert np.abs(slopes).max() == pytest.approx(np.tan(drawn.steepest_rad), rel=1e-4)


@pytest.mark.nightly
def test_dropout_leaves_out_the_same_units_that_torch_would(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both with the same units left out: torch's are put in by hand."""
    import torch

    table = pressed()
    by_torch, _ = pair(RECIPES["paper"], table)
    pixels, gradient = table.rows[:200, :5].copy(), table.rows[:200, 5:].copy()
    kept = kept_units((32, 400), 0.1, np.random.default_rng(0))
    assert set(np.unique(kept)) == {np.float32(0), np.float32(1 / 0.9)}
    assert (kept == 0).mean() == pytest.approx(0.1, abs=0.02)
    # torch is asked about the pixels first, then about unchanged ones.
    halves = iter(np.split(kept.T.copy(), 2))
    monkeypatch.setattr(torch.nn.Dropout, "forward", lambda self, x: x * torch.from_numpy(next(halves)))
    wanted, wanted_derivative = torch_derivative(by_torch, pixels, gradient)
    loss, derivative = loss_of_block(by_torch.parameters(), pixels.T, gradient.T, RECIPES["paper"], kept)
    assert loss / 200 == pytest.approx(wanted, rel=1e-6)
    np.testing.assert_allclose(derivative / 200, wanted_derivative, rtol=1e-5, atol=1e-6)


def test_dropout_is_left_out_of_answers_and_repeats_with_the_seed() -> None:
    table = pressed(per_image=100)
    pixels, gradient = table.rows[:, :5].copy(), table.rows[:, 5:].copy()
    network = random_network(pixels, gradient, width=32, random=np.random.default_rng(0))
    losses = []
    for seed in (1, 1, 2):
        trainer = NumpyTrainer(seed=seed)
        trainer.begin_with(network, RECIPES["paper"])
        losses.append(trainer.loss(pixels, gradient)[0])
        assert (trainer.answer(pixels) == trainer.answer(pixels)).all()
    assert losses[0] == losses[1] != losses[2]
