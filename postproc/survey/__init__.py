"""A survey: many runs of many walkers in one dataset, and where every cell of it stands.

walk_readings   a run -> its readings by cell, without what is private
parquet_batch   readings of many runs -> Parquet files, complete or not at all
dataset         what a survey holds: runs, cells, readings of a cell
intake          `survey add`
alignment       modems that share ground on one scale; loggers that contradict the others
cell_location   the readings of a cell -> where it stands
rule_inputs     what the rules of suspicion see of a run
suspicion       the words of all runs, the worst one of each cell
tasks           pieces of work, each a function of the dataset
scheduling      tasks on Dask, whatever happens to workers and scheduler
layers          results as GeoParquet and GeoPackage
"""
