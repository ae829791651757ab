"""The command line: one file a verb. Heavy imports stay inside the verb that needs them, or in `running/`."""
