"""What every room stands on: errors, settings, writing files, the mailbox. It knows no sensor.

errors.py    one tree of errors
settings.py  flags over environment over files over defaults
allowed.py   what a pydantic model allows, in a user's words
writing.py   files written whole or not at all, flushed to the disk
locking.py   locks on files, on Windows too, and one between threads whose users take turns
mailbox.py   keeps the newest item, from thread to thread
field_docs.py  fields in the `help()` of a dataclass
logs.py      what a service says: lines for people, or JSON
holders.py   who else has a device open
"""
