"""Makes the kits of this folder importable under `--import-mode=importlib`."""
