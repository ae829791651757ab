"""The trainers by name; a library is loaded when its trainer is made."""

from gelnet.training import Trainer

NAMES = ("numpy", "torch")
GPU = "cuda"
"""PyTorch on a GPU"""


def make_trainer(name: str, *, seed: int, threads: int = 1) -> Trainer:
    """Return a trainer; the same seed gives the same random numbers.

    threads: of torch. NumPy takes them from the environment, before it is loaded: OMP_NUM_THREADS and its kin. Raises
    `torch_trainer.NoGpuError` where "cuda" finds no GPU.
    """
    if name in ("torch", GPU):
        from gelnet.torch_trainer import TorchTrainer

        return TorchTrainer(seed=seed, threads=threads, by=name)
    from gelnet.numpy_trainer import NumpyTrainer

    return NumpyTrainer(seed=seed)
