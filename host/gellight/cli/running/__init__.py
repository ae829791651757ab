"""What a verb does, apart from its options: imported when it is run, not for its help."""
