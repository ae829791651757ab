"""SKiDL as a judge of circuits: the electrical rules that KiCad 6 checks in its window alone.

It runs in a folder of its own, where it leaves its logs, and is used here alone, never by what ships.
"""

import json
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

Circuit = dict[str, dict[str, tuple[str, str]]]
"""by part and pin: what the pin is (a name of SKiDL's `pin_types`), and its net, "" for none"""
CLEAN = "No errors or warnings found while running ERC"
NEXT = "----"
JUDGE = f"""
import json, sys
from skidl import SKIDL, Circuit, Net, Part, Pin
from skidl.pin import pin_types
for told in json.load(open(sys.argv[1])):
    print("{NEXT}", file=sys.stderr, flush=True)
    circuit, nets = Circuit(), {{}}
    for reference, pins in told.items():
        kinds = [Pin(num=number, name=number, func=pin_types[kind]) for number, (kind, _) in pins.items()]
        part = Part(name=reference, ref=reference, tool=SKIDL, pins=kinds, circuit=circuit)
        for number, (_, net) in pins.items():
            if net not in nets:
                nets[net] = Net(net, circuit=circuit) if net else circuit.NC
            nets[net] += part[number]
    circuit.ERC()
"""


def complaints(circuits: Sequence[Circuit], folder: Path) -> list[list[str]]:
    """Return the errors and warnings that SKiDL has for each circuit."""
    told = folder / "circuits.json"
    told.write_text(json.dumps(circuits))
    command = [sys.executable, "-c", JUDGE, told]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, timeout=60)
    verdicts = done.stderr.split(NEXT)[1:]
    found = [re.findall(r"^ERC (?:ERROR|WARNING): (.*)$", verdict, re.M) for verdict in verdicts]
    assert [CLEAN in verdict for verdict in verdicts] == [not those for those in found], done.stderr
    assert len(found) == len(circuits)
    return found
