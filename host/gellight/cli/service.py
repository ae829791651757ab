"""`gellight service`: let systemd start the sensor when the user logs in, and again when it fails."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import platformdirs
import typer

from gellight.base.allowed import check_name
from gellight.base.errors import InputError
from gellight.base.writing import make_folder, write_file
from gellight.cli.options import Overwrite, name_option

WATCHDOG_S = 30
"""without a frame, after which a service whose sensor is plugged in is started anew"""
UNIT = """[Unit]
Description=GelLight tactile sensor {name}

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
WatchdogSec={watchdog}
Restart=on-failure
RestartSec=2
TimeoutStartSec=60
TimeoutStopSec=10
NoNewPrivileges=yes
UMask=0077
LockPersonality=yes
RestrictSUIDSGID=yes
RestrictNamespaces=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallErrorNumber=EPERM

[Install]
WantedBy=default.target
"""
"""What it may not do needs no namespaces, which a user of some distributions may not make; `systemd-analyze security`
gives it 6.7, and 9.8 without."""

app = typer.Typer(help="Let systemd run the sensor of this user.", no_args_is_help=True)


@app.command()
def install(
    sensor: Annotated[str, typer.Option(help="As `gellight run` has it.")] = "auto",
    name: Annotated[str | None, name_option("Tells the services of several sensors apart.", "none")] = None,
    port: Annotated[int, typer.Option(help="Port of the dashboard.", min=0, max=65535)] = 8420,
    show: Annotated[bool, typer.Option("--print", help="Only print the unit file.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Write the unit file of a service of this user, which runs `gellight run`.

    What else is to be set stands in the user's config.toml, which `gellight config show` names.
    """
    text, path = unit(sensor, name, port), unit_path(name)
    if show:
        print(text, end="")
        return
    if path.exists() and not overwrite:
        raise InputError(f"{path} exists: give --overwrite, or another --name")
    try:
        make_folder(path.parent)
        write_file(path, text.encode())
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror})") from error
    print(f"{path} is written; start it now and whenever you log in:")
    print(f"    systemctl --user daemon-reload && systemctl --user enable --now {path.name}")
    print(f"its messages: journalctl --user -u {path.name}; without being logged in: loginctl enable-linger")


@app.command()
def remove(name: Annotated[str | None, name_option("As it was installed.", "none")] = None) -> None:
    """Remove the unit file again."""
    path = unit_path(name)
    if not path.exists():
        raise InputError(f"there is no {path}: nothing was installed under this name")
    path.unlink()
    print(f"{path} is removed; stop what still runs: systemctl --user disable --now {path.name}")


def unit_path(name: str | None) -> Path:
    """Return where the unit file of a service is."""
    file = "gellight.service" if name is None else f"gellight-{check_name(name)}.service"
    return platformdirs.user_config_path() / "systemd" / "user" / file


def unit(sensor: str, name: str | None, port: int) -> str:
    """Return the unit file; InputError for a sensor that would break its line."""
    if not sensor.strip() or not sensor.isprintable():
        raise InputError(f"--sensor {sensor!r} is not possible: give it in one line, as `gellight run` has it")
    words = [str(Path(sys.executable).parent / "gellight"), "run", "--sensor", sensor]
    words += ["--set", f"dashboard.port={port}", *(["--set", f"stream.name={name}"] if name else [])]
    # systemd takes % for the beginning of a specifier and $ for a variable
    command = shlex.join(words).replace("%", "%%").replace("$", "$$")
    return UNIT.format(name=name or sensor.replace("%", "%%"), command=command, watchdog=WATCHDOG_S)
