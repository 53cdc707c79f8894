"""Commands, one module each: ``add_arguments(parser)`` and ``run(args) -> int``. None imports an extra before it runs."""
