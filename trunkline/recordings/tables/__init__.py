"""Foreign tables (CSV, Parquet, npz, mat), as session.yaml declares them, to the streams that logs give."""
