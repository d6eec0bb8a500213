"""Engines that ship with this package; each module is a worker: ``python -m grainspan_worker.engines.NAME``."""
