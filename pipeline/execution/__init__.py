"""How a plan is carried out: tasks on threads or on a cluster."""
