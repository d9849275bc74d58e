#!/bin/bash
# A one-node Slurm on this machine, without systemd, cgroups and accounting: for tests.
#   cluster.sh up DIR      start it; its state and logs are in DIR
#   cluster.sh down DIR    end what was started, by pid
# Needs root and Debian's packages: apt-get install --no-install-recommends slurm-wlm munge
# The configuration must be in /etc/slurm: the jobs' environment loses SLURM_CONF.
set -euo pipefail
what=$1 dir=$2

down() {
  # What still runs would outlive the daemons.
  [ ! -s "$dir/slurmctld.pid" ] || timeout 10 scancel --user="$(id -un)" || true
  for name in slurmd slurmctld munged; do
    file=$dir/$name.pid
    if [ -s "$file" ] && kill -0 "$(cat "$file")" 2>/dev/null; then
      kill "$(cat "$file")"
      for _ in $(seq 100); do kill -0 "$(cat "$file")" 2>/dev/null || break; sleep 0.1; done
    fi
    rm -f "$file"
  done
}
if [ "$what" = down ]; then down; exit; fi

start() { # start NAME COMMAND...
  local name=$1
  shift
  setsid "$@" >"$dir/log/$name.log" 2>&1 &
  echo $! >"$dir/$name.pid"
}
if [ -e /etc/slurm/slurm.conf ] && ! grep -q ClusterName=pendtest /etc/slurm/slurm.conf; then
  echo "/etc/slurm/slurm.conf is that of another cluster: it is left alone" >&2
  exit 1
fi
host=$(hostname -s) memory=$(($(awk '/MemTotal/ {print $2}' /proc/meminfo) / 1024 * 9 / 10))
mkdir -p "$dir"/{state,spool,log} /run/munge /etc/slurm
# munge refuses to start unless its folder is its own and 0755.
chown munge:munge /run/munge && chmod 0755 /run/munge
if [ ! -s /etc/munge/munge.key ]; then
  dd if=/dev/urandom bs=1 count=128 status=none of=/etc/munge/munge.key
  chown munge:munge /etc/munge/munge.key && chmod 400 /etc/munge/munge.key
fi
start munged setpriv --reuid=munge --regid=munge --clear-groups munged --foreground --force
for _ in $(seq 50); do munge -n 2>/dev/null | unmunge >/dev/null 2>&1 && break; sleep 0.1; done
cat >/etc/slurm/slurm.conf <<CONF
ClusterName=pendtest
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
SlurmctldPort=6817
SlurmdPort=6818
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool
SlurmctldPidFile=$dir/slurmctld-own.pid
SlurmdPidFile=$dir/slurmd-own.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
DefMemPerCPU=500
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=2,bf_interval=2,batch_sched_delay=0,sched_min_interval=0
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
JobCompType=jobcomp/none
MpiDefault=none
ReturnToService=2
MinJobAge=86400
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
KillWait=2
MessageTimeout=30
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc --all) RealMemory=$memory State=UNKNOWN
PartitionName=debug Nodes=$host Default=YES MaxTime=INFINITE DefaultTime=10 State=UP OverSubscribe=NO
CONF
echo "CgroupAutomount=no" >/etc/slurm/cgroup.conf
start slurmctld slurmctld -D -c
start slurmd slurmd -D -N "$host"
for _ in $(seq 150); do
  case $(sinfo -h -o %T 2>/dev/null) in idle | mixed | allocated) exit 0 ;; esac
  sleep 0.2
done
echo "slurm did not come up" >&2
tail -5 "$dir"/log/*.log >&2
exit 1
