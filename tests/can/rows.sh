# Runs the arm on a CAN bus of the kernel, row by row, each with a fault, and prints their reports between marks.

graph=/graphs/arm-can.toml
export TERM=dumb
# Spinning before a release costs the emulator as much as computing, and the machine's clock never causes late
# wake-ups.
awake="--set realtime.spin=\"0us\""

# stamp: the seconds since the machine started, and the seconds in which its processor was idle.
stamp() { read -r up idle </proc/uptime; }

# begin NAME ARGUMENTS: starts a run and waits until it is running.
begin() {
    name=$1
    shift
    rm -f report errors
    stamp
    began="$up $idle"
    # The machine has one slow processor, on which the overheads that `check` assumes are not feasible.
    # shellcheck disable=SC2086
    motorium run "$graph" --no-expect --json --force $awake --set component.physics.rate='"1 kHz"' \
        --set component.physics.schedule='"fifo"' --set component.drives.schedule='"fifo"' "$@" >report 2>errors &
    run=$!
    running
}

# running: waits until the run is running.
running() {
    for _ in $(seq 500); do
        grep -qs 'connected, running' errors && break
        kill -0 $run 2>/dev/null || break
        sleep 0.02
    done
    stamp
    ran=$up
}

# printed NAME CODE REPORT ERRORS: prints a row, and its times: when it began, ran and ended, and when the processor was idle.
printed() {
    stamp
    echo "=== $1 $2"
    cat "$3"
    echo "--- errors"
    cat "$4"
    echo "--- times"
    echo "$began $ran $up $idle"
}

# finish: waits for the end of the run, and prints its report.
finish() {
    wait $run
    printed "$name" $? report errors
}

# row NAME TIME FAULTS: a run of this time with faults of the simulated drives, which follow within 30 ms; the first at 100 ms.
row() {
    begin "$1" --for "$2" --set "component.drives.config.faults=[{ at = \"100 ms\", $3 }]"
    finish
}

# Rows of the first of two machines: faults of the simulated drives and of the bus of the kernel. Faults that
# do not affect each other share a run: starting processes dominates the time of a short run.
socket_rows() {
    row silent 500ms 'kind = "silent", joint = "panda_joint4"'
    row late 500ms 'kind = "late", delay = "3 ms", joint = "panda_joint4"'
    row twice 500ms 'kind = "duplicate", joint = "panda_joint4" }, { at = "100 ms", kind = "twin", joint = "panda_joint2"'
    row refused 500ms 'kind = "wrong_length", joint = "panda_joint4" }, { at = "100 ms", kind = "corrupt", joint = "panda_joint2"'
    row off 500ms 'kind = "off", lasts = "50 ms", joint = "panda_joint4"'
    # a drive loses power briefly: one command releases the trip once the drive is back
    begin resumed --for 1s --set 'component.drives.config.faults=[{ at = "100 ms", kind = "off", lasts = "50 ms", joint = "panda_joint4" }]'
    sleep 0.3
    motorium resume >resumed 2>&1
    finish
    row bus_off 600ms 'kind = "bus_off", lasts = "200 ms", bus = "can0"'

    begin unacknowledged --for 600ms
    sleep 0.1
    motorium can send vcan0 20000020#0000000000000000
    finish

    begin down --for 1s
    sleep 0.1
    ip link set vcan0 down
    sleep 0.3
    ip link set vcan0 up
    finish

    # a missing interface is polled once a second
    begin gone --for 2s
    sleep 0.1
    ip link del vcan0
    sleep 0.3
    ip link add vcan0 type vcan
    ip link set vcan0 mtu 72
    ip link set vcan0 up
    finish

    begin missing_interface --for 1s --set 'component.adapter.config.drives="drives/missing.toml"'
    finish
}

# Processes that are killed, or stopped.
process_rows() {
    begin adapter_killed --for 600ms --set component.adapter.on_failure='"ignore"'
    sleep 0.1
    motorium kill arm-can adapter
    finish

    begin adapter_hung --for 600ms --set component.adapter.on_failure='"ignore"'
    sleep 0.1
    motorium kill arm-can adapter --signal stop
    finish

    begin controller_killed --for 900ms --set component.controller.on_failure='"ignore"'
    sleep 0.1
    motorium kill arm-can controller
    finish

    begin controller_stopped --for 900ms --set component.controller.on_failure='"ignore"'
    sleep 0.1
    motorium kill arm-can controller --signal stop
    finish

    # The adapter is killed, and hangs, repeatedly: it restarts each time, and the drives follow again.
    for fault in kill stop; do
        kills=$(cat /graphs/kills)
        begin "adapter_${fault}_often" --for "$((20 * kills + 30))s" \
            --set component.adapter.restart="{ when = \"failure\", at_most = $((kills + 1)), window = \"1000 s\" }" \
            --set component.adapter.hang_after='"100 ms"'
        # its drives are checked and enabled first
        sleep 0.2
        for count in $(seq "$kills"); do
            motorium kill arm-can adapter --signal $fault >>killed 2>&1
            # the back-off before a restart grows with each restart
            for _ in $(seq 200); do
                [ "$(grep -c 'steps again' errors)" -ge "$count" ] && break
                sleep 0.1
            done
            # its drives are checked and enabled meanwhile
            sleep 0.3
        done
        kill -INT $run
        finish
    done

    begin launcher_killed --for 5s
    motorium can log vcan0 --overwrite --output traffic &
    log=$!
    sleep 0.3
    kill -9 $run
    sleep 2
    kill -INT $log
    wait $log
    motorium can log vcan0 --for 300ms >silence
    code=$?
    tail -n 16 traffic >report
    ps | grep -c '[m]otorium worker' >errors
    wc -l <silence >>errors
    printed launcher_killed $code report errors
}

# desk GRAPH FAULT: starts physics and drives alone, on a separate bus, with a fault, and waits for
# them to run.
desk() {
    rm -f desk desk_errors
    stamp
    began="$up $idle"
    # shellcheck disable=SC2086
    motorium run "$1" --json --force --no-expect --for 30s $awake --set component.physics.schedule='"fifo"' \
        --set component.drives.schedule='"fifo"' --set "component.drives.config.faults=[$2]" >desk 2>desk_errors &
    desk=$!
    until grep -qs 'connected, running' desk_errors; do
        kill -0 $desk 2>/dev/null || break
        sleep 0.02
    done
    stamp
    ran=$up desk_times="$began $up"
}

# desk_ends NAME: ends them, and prints their report.
desk_ends() {
    kill -INT $desk
    wait $desk
    code=$?
    began=${desk_times% *} ran=${desk_times##* }
    printed "$1" $code desk desk_errors
}

# slcan NAME FAULT TIME: the arm behind the driver of the kernel, attached to the terminal of the desk, for
# this time. The desk's bus has the fault 1.2 s after the desk began, more than half a second after the arm.
# The operator's repair is called `mend`: once the fault is over.
slcan() {
    name=$1
    desk /graphs/desk.toml "$2"
    until [ -e /tmp/can0 ]; do
        kill -0 $desk 2>/dev/null || break
        sleep 0.02
    done
    attach
    rm -f report errors
    stamp
    began="$up $idle"
    # shellcheck disable=SC2086
    motorium run /graphs/slcan.toml --no-expect --json --force --for "$3" $awake >report 2>errors &
    run=$!
    running
    mend
    finish
    # drives without commands are disabled
    sleep 0.1
    desk_ends "${name}_desk"
    detach
}

# attach: attaches the kernel driver to the terminal; detach: detaches it.
attach() {
    rm -f attached
    motorium can attach /tmp/can0 >attached 2>>desk_errors &
    attached=$!
    until [ -s attached ]; do
        kill -0 $attached 2>/dev/null || break
        sleep 0.02
    done
}
detach() {
    kill -INT $attached 2>/dev/null
    wait $attached
}

# scan NAME ARGUMENTS: a search for drives that speak CAN FD.
scan() {
    name=$1
    shift
    stamp
    began="$up $idle" ran=$up
    motorium can scan "$@" --fd --for 50ms --json >report 2>errors
    printed "$name" $? report errors
}

# Rows of the second: ends of processes, the kernel driver for serial adapters, twelve joints, CAN FD drives,
# and the output of `check`.
serial_rows() {
    # the traffic of the babbling node leaves no time in the cycle of a test build, so the release build runs
    # here
    row disturbed 650ms 'kind = "babbling", lasts = "200 ms", bus = "can0" }, { at = "350 ms", kind = "disturbed", lasts = "200 ms", bus = "can0"'
    process_rows
    mend() { :; }
    slcan slcan '' 1s
    slcan slcan_alone '{ at = "1.2 s", lasts = "300 ms", kind = "alone", bus = "can0" }' 2s
    slcan slcan_passive '{ at = "1.2 s", lasts = "18 ms", kind = "disturbed", bus = "can0" }' 1500ms
    mend() {
        sleep 1.5
        ip link set can0 down
        ip link set can0 up
    }
    slcan slcan_bus_off '{ at = "1.2 s", lasts = "300 ms", kind = "bus_off", bus = "can0" }' 3s
    mend() {
        sleep 1.5
        detach
        attach
    }
    slcan slcan_unplugged '{ at = "1.2 s", lasts = "300 ms", kind = "down", bus = "can0" }' 3500ms

    graph=/graphs/two-buses.toml
    begin twelve --for "$(cat /graphs/seconds)s"
    finish

    # a drive that sends classic frames, and two moteus on a separate bus
    desk /graphs/drives-alone.toml ''
    scan scan_fd vcan1
    scan scan_classic vcan0
    desk_ends scanned_desk
    ip link set vcan1 down
    ip link set vcan1 mtu 16
    ip link set vcan1 up
    scan scan_no_fd vcan1

    stamp
    began="$up $idle" ran=$up
    motorium can check /graphs/arm-can.toml --set component.adapter.rate='"1 kHz"' >report 2>errors
    printed saturated $? report errors
}

# At a priority above all others, so that only the clock of the machine can delay it.
chrt -f 99 clock-watch >leaps &
watch=$!
"$(cat /graphs/rows)_rows"
kill $watch
: >errors
stamp
began="$up $idle" ran=$up
printed "$(cat /graphs/rows)_leaps" 0 leaps errors
