"""The tab of a run: charts, inspector, changes by hand, files."""
