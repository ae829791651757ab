"""Training: it learns what is in the table, the same each time, and refuses a table that says nothing."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gelnet.recipes import RECIPES, Recipe, learning_rates
from gelnet.table import Table, TableError, checked, load_table
from gelnet.train import main
from gelnet.trainers import make_trainer
from gelnet.training import Training, normal_error_deg, train
from tests.helpers.children import run
from tests.helpers.trainers import TRAINERS, rows_of_a_known_sensor

ROOT = Path(__file__).parent.parent.parent
both = pytest.mark.parametrize("trainer", TRAINERS)
TINY = replace(RECIPES["fast"], epochs=2, least_visits=0)


def arrays(images: int = 6, per_image: int = 400) -> dict[str, np.ndarray]:
    image = np.repeat(np.arange(images, dtype=np.int32), per_image)
    rows = rows_of_a_known_sensor(images * per_image, steepest=0.8, seed=5)
    return {"rows": rows, "image": image, "image_size": np.array([320, 240], np.int32)}


def table(**sizes: int) -> Table:
    return checked(**arrays(**sizes))


def saved(place: Path, **changes: np.ndarray) -> Path:
    np.savez(place / "table.npz", **{**arrays(), **changes})
    return place / "table.npz"


def trained_by(trainer: str, learnt: Table, recipe: Recipe, *, width: int = 16, seed: int = 0) -> Training:
    return train(learnt, recipe, make_trainer(trainer, seed=seed), width=width)


@both
def test_it_learns_a_known_sensor_to_half_a_degree(trainer: str) -> None:
    rows = table(per_image=2000)
    training, held_out = rows.chosen(rows.image > 1), rows.chosen(rows.image < 2)
    recipe = replace(RECIPES["fast"], least_visits=400_000, batch=256, place_jitter=0.0)
    trained = trained_by(trainer, training, recipe)
    assert normal_error_deg(trained.network, held_out)["mean"] < 0.5
    assert trained.losses[-1] < trained.losses[0] / 3


def test_the_paper_recipe_is_the_paper() -> None:
    paper = RECIPES["paper"]
    assert (paper.loss, paper.learning_rate, paper.batch, paper.epochs) == ("gradient", 1e-6, 128, 150)
    assert paper.dropout > 0
    assert set(learning_rates(paper, steps=5)) == {1e-6}


@both
def test_the_paper_recipe_goes_downhill(trainer: str) -> None:
    # Without its dropout, which is louder than 3 of its 150 tiny epochs.
    trained = trained_by(trainer, table(), replace(RECIPES["paper"], epochs=3, dropout=0.0))
    assert trained.losses[2] < trained.losses[1] < trained.losses[0]


def test_the_learning_rate_rises_then_falls_to_nothing() -> None:
    rates = list(learning_rates(RECIPES["fast"], steps=100))
    top = int(np.argmax(rates))
    assert rates[top] == pytest.approx(RECIPES["fast"].learning_rate)
    assert 1 <= top <= 10
    assert all(np.diff(rates[: top + 1]) > 0)
    assert all(np.diff(rates[top + 1 :]) < 0)
    assert rates[-1] < 0.01 * rates[top]


@both
def test_the_same_seed_gives_the_same_network_and_another_seed_another(trainer: str) -> None:
    rows = table().rows[:, :5]
    first, again, other = (
        trained_by(trainer, table(), TINY, width=8, seed=seed).network.answer(rows) for seed in (4, 4, 5)
    )
    assert (first == again).all()
    assert (first != other).any()


@both
def test_a_large_table_is_thinned_and_a_small_one_seen_more_often(trainer: str) -> None:
    assert trained_by(trainer, table(), replace(TINY, largest_table=1000), width=4).rows == 1000
    assert trained_by(trainer, table(), replace(TINY, least_visits=12_000), width=4).epochs == 5


def test_one_press_is_enough_to_learn_from() -> None:
    assert trained_by("numpy", table(images=1), TINY, width=4).rows == 400


UNTOUCHED, LIKE, IMAGE = np.full((240, 320, 3), 120, np.float32), arrays()["rows"], arrays()["image"]
FLAT = np.hstack([LIKE[:, :5], 0 * LIKE[:, 5:]])
WRONG = {
    "nan": ({"rows": np.full((4, 7), np.nan, np.float32), "image": np.arange(4)}, "28 values are not finite"),
    "empty": ({"rows": np.zeros((0, 7), np.float32), "image": np.zeros(0, np.int32)}, "no rows"),
    "no press": ({"rows": FLAT, "untouched": UNTOUCHED}, "all slopes are 0"),
    "like unit without a press": ({"untouched": UNTOUCHED, "like_rows": FLAT, "like_image": IMAGE}, "all slopes are 0"),
}


@pytest.mark.parametrize(("changes", "message"), WRONG.values(), ids=WRONG)
def test_a_table_that_says_nothing_is_refused_with_status_2_and_nothing_is_written(
    changes: dict[str, np.ndarray], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = saved(tmp_path, **changes)
    with pytest.raises(TableError, match=message):
        load_table(path)
    assert main(["--trainer", "numpy", "--table", str(path), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.startswith(f"gelnet.train: {path}")
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_no_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.npz"
    with pytest.raises(TableError, match="cannot be read"):
        load_table(path)
    path.write_bytes(b"PK\x03\x04 cut")
    with pytest.raises(TableError, match="cannot be read"):
        load_table(path)
    np.savez(path, rows=np.zeros((3, 7)))
    with pytest.raises(TableError, match="cannot be read"):
        load_table(path)


@both
def test_the_child_reports_each_epoch_and_writes_both_files(trainer: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gelnet.train", "--table", str(saved(tmp_path)), "--out", str(tmp_path / "out")]
    command += ["--trainer", trainer, "--epochs", "3", "--width", "8", "--seed", "2"]
    child = run(command, env={"PYTHONPATH": f"{ROOT / 'models'}", "PATH": ""})
    assert child.returncode == 0, child.stderr
    progress = [json.loads(line) for line in child.stdout.splitlines()]
    assert [(step["epoch"], step["epochs"]) for step in progress] == [(epoch, 3) for epoch in range(1, 4)]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["network.onnx", "training.json"]
    record = json.loads((tmp_path / "out/training.json").read_text())
    assert record["losses"] == [step["loss"] for step in progress]
    assert (record["recipe"], record["width"], record["seed"], record["epochs"]) == ("fast", 8, 2, 3)
    assert record["images"] == 6
    assert record["trainer"].split()[0] == trainer


@pytest.mark.parametrize(
    "arguments",
    [["--width", "0"], ["--epochs", "0"], ["--recipe", "slow"], ["--threads", "0"], ["--trainer", "pencil"]],
)
def test_wrong_arguments_are_refused(arguments: list[str], tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["--trainer", "numpy", "--table", str(saved(tmp_path)), "--out", str(tmp_path / "out"), *arguments])
    assert stopped.value.code == 2
    assert not (tmp_path / "out").exists()
