"""Care for a whole cache: verify it, clean it, exchange parts of it as archives."""
