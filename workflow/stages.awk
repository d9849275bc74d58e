# Snakemake's output with `--quiet rules` to a line a stage: what `make campaign` prints.
# Errors, warnings of the jobs and the report's numbers pass.
/^Job stats:/ { table = 1; next }
table && $1 == "total" { jobs = $2; table = 0; printf "%d jobs to run\n", jobs; fflush(); next }
table && NF == 2 && $2 ~ /^[0-9]+$/ { jobs_of[$1] = $2; next }
table { next }
/^Finished jobid: / {
  rule = $NF; sub(/\)$/, "", rule)
  if (++done[rule] == jobs_of[rule] && rule != "all") {
    printf "%s: %d done\n", rule, done[rule]; fflush()
  }
  next
}
/^\[[A-Z][a-z][a-z] [A-Z]/ || /^(Select|Execute) / || /steps \([0-9]+%\) done$/ { next }
/^(Building DAG|Using shell|Provided cores|Rules claiming|Conda env|Assuming|Config file|Complete log|Elapsed time|Nothing to be done)/ {
  if ($1 == "Nothing") print
  next
}
/^host: / || /^SNAKEMAKE|^=+$/ || /^  [A-Z][A-Za-z0-9 ()]+: / || /^ *$/ { next }
{ print; fflush() }
