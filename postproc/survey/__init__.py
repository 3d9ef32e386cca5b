"""A survey: many runs of many walkers in one dataset, and where every cell of it stands.

sources         the files of folders that are runs or logs
walk_readings   a run -> its readings by cell, without what is private
batch           readings of many runs -> Parquet files, complete or not at all
dataset         what a survey holds: runs, cells, readings of a cell
intake          `survey add`
alignment       modems that share ground on one scale; loggers that contradict the others
thinning        a cell with very many readings
places          ground far from other ground: towns, and places of one identity
cell_location   the readings of a cell -> where it stands
rule_inputs     what the rules of suspicion see of a run
suspicion       the words of all runs, the worst one of each cell
tasks           pieces of work, each a function of the dataset
scheduling      tasks on Dask, whatever happens to workers and scheduler
layers          results as GeoParquet and GeoPackage
"""
