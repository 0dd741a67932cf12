#!/bin/bash
# A campaign on a real Slurm, with a node that dies in the middle of it.
#
# Sets up munge, slurmctld and two slurmd on this machine, each node under its own host name,
# as two nodes of a cluster; submits a sweep; kills one node with everything that runs on it;
# waits until Slurm has requeued its shard (after two minutes); merges, and compares the bytes with those of a
# single process. Everything is stopped at the end.
#
#   apt-get install -y --no-install-recommends slurmctld slurmd slurm-client munge
#   cargo build --release && sudo tests/slurm/run.sh
#
# It uses separate ports, folders and names, so a running Slurm is not affected.

set -euo pipefail

repository=$(cd "$(dirname "$0")/../.." && pwd)
painleve=${PAINLEVE:-$repository/target/release/painleve}
work=$(mktemp -d /tmp/painleve-slurm.XXXXXX)
nodes=(paine1 paine2)
pids=()

fail() { echo "FAILED: $*" >&2; exit 1; }

# Prints the descendants of a process, youngest first, then the process itself.
tree() { local child; for child in $(pgrep -P "$1"); do tree "$child"; done; echo "$1"; }

# Tasks do not belong to slurmd's tree: they run under a slurmstepd of the node.
of_node() { pgrep -f "^slurmstepd: .*" | while read -r id; do
    [ "$(readlink "/proc/$id/ns/uts")" = "$(readlink "/proc/$1/ns/uts")" ] && tree "$id"; done || true; }

kill_node() {
    local id
    for id in $(of_node "$1") $(tree "$1"); do kill -KILL "$id" 2>/dev/null || true; done
}

finish() {
    local code=$? id
    trap - EXIT
    for id in "${node_pids[@]:-}"; do [ -n "$id" ] && kill_node "$id"; done
    for id in "${pids[@]:-}"; do [ -n "$id" ] && kill "$id" 2>/dev/null || true; done
    wait 2>/dev/null || true
    if [ $code -ne 0 ]; then
        tail -n 20 "$work"/*.log "$work"/sweep/slurm-*.log >&2 2>/dev/null || true
    fi
    rm -rf "$work"
    exit $code
}
node_pids=()
trap finish EXIT

[ "$(id -u)" = 0 ] || fail "munge, slurmctld and slurmd must be started by root"
for program in munged slurmctld slurmd sbatch unshare pgrep; do
    command -v "$program" > /dev/null || fail "there is no $program: see the head of this script"
done
[ -x "$painleve" ] || fail "there is no $painleve: run cargo build --release"

echo "== munge"
chmod 755 "$work"
mkdir -m 755 "$work/munge"
dd if=/dev/urandom of="$work/munge/key" bs=128 count=1 status=none
chmod 600 "$work/munge/key"
munged --foreground --key-file="$work/munge/key" --socket="$work/munge/socket" \
    --pid-file="$work/munge/pid" --seed-file="$work/munge/seed" > "$work/munged.out.log" 2>&1 &
pids+=($!)
for _ in $(seq 50); do [ -S "$work/munge/socket" ] && break; sleep 0.1; done
[ -S "$work/munge/socket" ] || fail "munged does not start"

echo "== slurmctld and two slurmd"
host=$(hostname -s)
mkdir -p "$work/state"
cat > "$work/slurm.conf" <<CONF
ClusterName=painleve
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=26817
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CryptoType=crypto/munge
SlurmUser=root
StateSaveLocation=$work/state
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.%n.pid
SlurmdSpoolDir=$work/spool.%n
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=batch_sched_delay=1,sched_interval=2
# A node that does not answer for this long is down, and its tasks are requeued.
SlurmdTimeout=10
ReturnToService=1
MpiDefault=none
CONF
port=26820
for node in "${nodes[@]}"; do
    mkdir -p "$work/spool.$node"
    echo "NodeName=$node NodeAddr=127.0.0.1 Port=$port CPUs=1 State=UNKNOWN" >> "$work/slurm.conf"
    port=$((port + 1))
done
echo "PartitionName=all Nodes=$(IFS=,; echo "${nodes[*]}") Default=YES MaxTime=INFINITE State=UP" >> "$work/slurm.conf"
export SLURM_CONF=$work/slurm.conf
slurmctld -D -c > "$work/slurmctld.out.log" 2>&1 &
pids+=($!)
for node in "${nodes[@]}"; do
    # A separate host name, as on a separate machine.
    unshare --uts sh -c "hostname $node && exec slurmd -D -N $node" > "$work/$node.out.log" 2>&1 &
    node_pids+=($!)
done
for _ in $(seq 100); do
    [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = 2 ] && break
    sleep 0.3
done
sinfo
[ "$(sinfo -h -t idle -o %D)" = 2 ] || fail "the nodes do not come up"

echo "== plan and submit"
cat > "$work/campaign.toml" <<CAMPAIGN
study = "bifurcation"
mu = [0.4, 0.6]
v-belt = "-0.6:-0.3:0.005"
initial = ["a", "random:1"]
transient-s = ${TRANSIENT_S:-1000}
CAMPAIGN
folder=$work/sweep
"$painleve" sweep plan "$work/campaign.toml" --shards 5 --folder "$folder"
"$painleve" sweep submit slurm --folder "$folder"
cat "$folder/sweep.sbatch"
job=$(sbatch --parsable "$folder/sweep.sbatch")

echo "== kill node ${nodes[1]} while it computes"
for _ in $(seq 100); do
    victim=$(squeue -h -j "$job" -r -t running -w "${nodes[1]}" -o %K 2>/dev/null)
    [ -n "$victim" ] && [ -n "$(of_node "${node_pids[1]}")" ] && break
    sleep 0.2
done
[ -n "$victim" ] || fail "nothing runs on ${nodes[1]}"
sleep 1
[ -e "$folder/shard-$victim.csv" ] && fail "shard $victim was finished before its node was killed"
squeue -r
kill_node "${node_pids[1]}"
echo "shard $victim ran on ${nodes[1]}, which is dead"
"$painleve" sweep status --folder "$folder"
if "$painleve" sweep merge --folder "$folder"; then fail "a sweep with gaps was merged"; fi

echo "== Slurm notices, requeues shard $victim and runs it on ${nodes[0]}"
restarts=0
for _ in $(seq 400); do
    [ -z "$(squeue -h -j "$job" 2>/dev/null)" ] && break
    now=$(scontrol show job "${job}_$victim" 2>/dev/null | sed -n 's/.*Restarts=\([0-9]*\).*/\1/p' | head -1)
    [ "${now:-0}" -gt "$restarts" ] && { restarts=$now; echo "shard $victim: restarts=$restarts"; sinfo; }
    sleep 0.5
done
[ "$restarts" -ge 1 ] || fail "shard $victim was not requeued"
missing=$("$painleve" sweep missing --folder "$folder")
[ -z "$missing" ] || fail "shards $missing are missing"
grep -H . "$folder"/slurm-*.log

echo "== merge"
"$painleve" sweep merge --folder "$folder"
"$painleve" sweep plan "$work/campaign.toml" --shards 1 --folder "$work/alone"
"$painleve" sweep run --shard 0/1 --folder "$work/alone"
"$painleve" sweep merge --folder "$work/alone"
cmp "$folder/merged.csv" "$work/alone/merged.csv" || fail "the bytes differ"
echo "PASSED: shard $victim was requeued $restarts time(s); $(wc -l < "$folder/merged.csv") lines, the same bytes as of one process"
