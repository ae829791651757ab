"""Whether a PNG can be unpacked safely: OpenCV makes room for what a chunk claims to be, gigabytes of a small file."""

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_AROUND = 12
"""bytes of a chunk beside its data: length, name, checksum (ISO/IEC 15948, 5.3)"""


def is_whole(content: bytes) -> bool:
    """Return whether this is a PNG, and all of it is there."""
    return content.startswith(SIGNATURE) and not cut_off(content)


def cut_off(content: bytes) -> bool:
    """Return whether this is a PNG with a chunk that is longer than what is left of it."""
    if not content.startswith(SIGNATURE):
        return False
    at = len(SIGNATURE)
    while at + 8 <= len(content):
        name, at = content[at + 4 : at + 8], at + _AROUND + int.from_bytes(content[at : at + 4])
        if name == b"IEND":
            break
    return at > len(content)
