"""The gel along its surface, from its marker dots."""
