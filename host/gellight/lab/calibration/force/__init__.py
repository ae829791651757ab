"""What turns depth into newtons, from known weights or a load cell."""
