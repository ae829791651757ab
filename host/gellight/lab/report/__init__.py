"""What people are shown: maps as pictures, and the page of a report."""
