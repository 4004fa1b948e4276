"""What people look at: figures of every product."""
