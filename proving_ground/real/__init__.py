"""Records of real instruments, and causes planted into them."""
