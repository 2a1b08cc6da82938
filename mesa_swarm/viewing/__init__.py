"""What browsers draw: frames as bytes, and the script that plays them."""
