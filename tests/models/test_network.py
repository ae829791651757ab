"""GelNet: what goes in, what comes out, and that its ranges are inside."""

from typing import Any

import pytest

from gelnet.parameters import STEEPEST_RAD

pytestmark = pytest.mark.nightly
torch: Any = pytest.importorskip("torch")
GelNet: Any = pytest.importorskip("gelnet.network").GelNet


def pixels(count: int, seed: int = 0) -> Any:
    random = torch.Generator().manual_seed(seed)
    scale = torch.tensor([40.0, 30.0, 20.0, 300.0, 200.0])
    return (torch.rand((count, 5), generator=random) - 0.3) * scale


def network(width: int = 8) -> Any:
    torch.manual_seed(0)
    made = GelNet(width)
    made.fit_range(pixels(500), torch.rand((500, 2)) - 0.5)
    return made.eval()


def test_it_has_five_fully_connected_layers_and_dropout_before_the_last() -> None:
    made = GelNet(24, dropout=0.1)
    layers = [module for module in made.modules() if isinstance(module, torch.nn.Linear)]
    assert [(layer.in_features, layer.out_features) for layer in layers] == [(5, 24)] + [(24, 24)] * 3 + [(24, 2)]
    assert made.width == 24
    made.train()
    torch.manual_seed(1)
    assert not torch.equal(made(pixels(50)), made(pixels(50)))
    made.eval()
    assert torch.equal(made(pixels(50)), made(pixels(50)))


@pytest.mark.parametrize("count", [0, 1, 4097])
def test_any_number_of_pixels_gives_as_many_gradients(count: int) -> None:
    assert network()(pixels(count)).shape == (count, 2)


def test_no_input_makes_a_slope_steeper_than_the_bound() -> None:
    made = network()
    with torch.no_grad():
        made.output.weight.mul_(1e6)
        slopes = made(pixels(1000) * 1e4)
    assert torch.isfinite(slopes).all()
    limit = torch.tan(made.steepest_rad)
    assert float(slopes.abs().max()) == pytest.approx(float(limit), rel=1e-4)
    assert float(made.steepest_rad) <= STEEPEST_RAD


def test_the_bound_leaves_room_for_the_steepest_training_slope() -> None:
    made = GelNet(4)
    made.fit_range(pixels(10), torch.tensor([[0.0, 2.0]] * 10))
    assert float(torch.tan(made.steepest_rad)) > 2.0
    made.fit_range(pixels(10), torch.full((10, 2), 1e9))
    assert float(made.steepest_rad) == pytest.approx(STEEPEST_RAD)


def test_units_of_the_input_do_not_matter_because_the_range_is_inside() -> None:
    seen = pixels(500)
    scale, shift = torch.tensor([3.0, 0.5, 10.0, 2.0, 7.0]), torch.tensor([5.0, -20.0, 0.0, 100.0, 3.0])
    gradient = torch.rand((500, 2)) - 0.5
    answers = []
    for rows in (seen, seen * scale + shift):
        torch.manual_seed(3)
        made = GelNet(8)
        made.fit_range(rows, gradient)
        answers.append(made(rows))
    assert torch.allclose(*answers, atol=1e-5)


def test_a_column_that_never_changes_does_not_divide_by_nothing() -> None:
    rows = pixels(100)
    rows[:, 3] = 7.0
    made = GelNet(4)
    made.fit_range(rows, torch.zeros((100, 2)))
    assert torch.isfinite(made(rows)).all()


@pytest.mark.parametrize(("width", "dropout"), [(0, 0.0), (8, 1.0), (8, -0.1)])
def test_an_impossible_network_is_refused(width: int, dropout: float) -> None:
    with pytest.raises(ValueError, match=f"width {width}"):
        GelNet(width, dropout=dropout)
