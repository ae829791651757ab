"""Write the C header and the document of the protocol: `python firmware/generate.py`, after a change of its definition.

The definition is host/gellight/ring/protocol.py.
"""

from gellight.ring.firmware.generate import generate
from gellight.ring.firmware.targets import CHECKOUT

if __name__ == "__main__":
    for path in generate(CHECKOUT):
        print(f"wrote {path}")
