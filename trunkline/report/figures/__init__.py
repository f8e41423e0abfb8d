"""Every figure. No stage depends on this folder: to draw again, `dvc repro --force --single-item STAGE`."""
