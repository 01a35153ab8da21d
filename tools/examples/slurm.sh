#!/bin/bash
# A project's photons on 16 machines of a cluster, then everything else on one.
#
# Usage: sbatch --array=1-16 --job-name=glintmap slurm.sh PROJECT
# and, once all are there (the same bytes as one machine would write):
#        sbatch --dependency=afterok:JOB --cpus-per-task=8 --wrap "glintmap run PROJECT"
#
# A task that was killed or preempted goes on where it was when it is submitted again.
#SBATCH --job-name=glintmap
#SBATCH --array=1-16
#SBATCH --cpus-per-task=8
#SBATCH --mem=4G
#SBATCH --requeue
set -euo pipefail
project=${1:?the folder of the project, on a file system that all machines share}
glintmap run "$project" --until trace \
    --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
    --threads "$SLURM_CPUS_PER_TASK" --memory 3GiB
