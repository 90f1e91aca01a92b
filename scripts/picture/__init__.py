"""Pictures of simulated tissue, drawn in software with numpy: no display, no GPU."""
