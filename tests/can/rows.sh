# Runs the arm on a CAN bus of the kernel, row by row, each with a fault, and prints their reports between marks.

graph=/graphs/arm-can.toml
export TERM=dumb

# begin NAME ARGUMENTS: starts a run and waits until it is running.
begin() {
    name=$1
    shift
    rm -f report errors
    # The machine has one slow processor, on which the times that `check` assumes of a machine do not fit.
    motorium run "$graph" --no-expect --json --force --set component.physics.rate='"1 kHz"' \
        --set component.physics.schedule='"fifo"' --set component.drives.schedule='"fifo"' "$@" >report 2>errors &
    run=$!
    for _ in $(seq 500); do
        grep -q running errors && break
        kill -0 $run 2>/dev/null || break
        sleep 0.02
    done
}

# finish: waits for the end of the run, and prints its report.
finish() {
    wait $run
    code=$?
    echo "=== $name $code"
    cat report
    echo "--- errors"
    cat errors
}

# row NAME FAULT [ARGUMENTS]: a run with a fault of the simulated drives.
row() {
    name=$1 fault=$2
    shift 2
    begin "$name" --for 800ms --set "component.drives.config.faults=[{ at = \"300 ms\", $fault }]" "$@"
    finish
}

# Rows of the first of two machines: faults of the simulated drives and of the bus of the kernel, and ends of processes.
socket_rows() {
    row silent 'kind = "silent", joint = "panda_joint4"'
    row late 'kind = "late", delay = "3 ms", joint = "panda_joint4"'
    row duplicate 'kind = "duplicate", joint = "panda_joint4"'
    row twin 'kind = "twin", joint = "panda_joint4"'
    row wrong_length 'kind = "wrong_length", joint = "panda_joint4"'
    row corrupt 'kind = "corrupt", joint = "panda_joint4"'
    row off 'kind = "off", lasts = "50 ms", joint = "panda_joint4"'
    # a drive without power for a moment: what trips is released by one command, once the drive is back
    begin resumed --for 1500ms --set 'component.drives.config.faults=[{ at = "300 ms", kind = "off", lasts = "50 ms", joint = "panda_joint4" }]'
    sleep 0.7
    motorium resume >resumed 2>&1
    finish
    row babbling 'kind = "babbling", lasts = "200 ms", bus = "can0"'
    row passive 'kind = "disturbed", lasts = "200 ms", bus = "can0"'
    row bus_off 'kind = "bus_off", lasts = "200 ms", bus = "can0"'

    begin unacknowledged --for 800ms
    sleep 0.3
    motorium can send vcan0 20000020#0000000000000000
    finish

    begin down --for 2s
    sleep 0.3
    ip link set vcan0 down
    sleep 0.3
    ip link set vcan0 up
    finish

    begin gone --for 3s
    sleep 0.3
    ip link del vcan0
    sleep 0.3
    ip link add vcan0 type vcan
    ip link set vcan0 mtu 72
    ip link set vcan0 up
    finish

    begin missing_interface --for 1s --set 'component.adapter.config.drives="drives/missing.toml"'
    finish

    begin adapter_killed --for 1s --set component.adapter.on_failure='"ignore"'
    sleep 0.3
    motorium kill arm-can adapter
    finish

    begin adapter_hung --for 1s --set component.adapter.on_failure='"ignore"'
    sleep 0.3
    motorium kill arm-can adapter --signal stop
    finish

    begin controller_killed --for 1s --set component.controller.on_failure='"ignore"'
    sleep 0.3
    motorium kill arm-can controller
    finish

    begin controller_stopped --for 1s --set component.controller.on_failure='"ignore"'
    sleep 0.3
    motorium kill arm-can controller --signal stop
    finish

    # The adapter killed, and hung, again and again: it is started anew each time, and leads the drives back.
    for fault in kill stop; do
        kills=$(cat /graphs/kills)
        begin "adapter_${fault}_often" --for "$((20 * kills + 30))s" \
            --set component.adapter.restart="{ when = \"failure\", at_most = $((kills + 1)), window = \"1000 s\" }" \
            --set component.adapter.hang_after='"100 ms"'
        for count in $(seq "$kills"); do
            motorium kill arm-can adapter --signal $fault >>killed 2>&1
            # the pause before a restart grows with each of them
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
    motorium can log vcan0 --output traffic &
    log=$!
    sleep 0.3
    kill -9 $run
    sleep 2
    kill -INT $log
    wait $log
    motorium can log vcan0 --for 300ms >silence
    echo "=== launcher_killed $?"
    tail -n 16 traffic
    echo "--- errors"
    ps | grep -c '[m]otorium worker'
    wc -l <silence
}

# slcan NAME FAULT TIME: the arm behind the driver of the kernel, which sits on the terminal that the desk offers, for some time. The
# desk's bus has the fault 2.5 s after the desk began, about 2 s after the arm. What a person would do then is called `mend`.
slcan() {
    name=$1 fault=$2
    rm -f desk desk_errors report errors
    motorium run /graphs/desk.toml --json --force --no-expect --for 30s --set component.physics.schedule='"fifo"' \
        --set component.drives.schedule='"fifo"' --set "component.drives.config.faults=[$fault]" >desk 2>desk_errors &
    desk=$!
    until [ -e /tmp/can0 ] && grep -q running desk_errors; do
        kill -0 $desk 2>/dev/null || break
        sleep 0.02
    done
    attach
    motorium run /graphs/slcan.toml --no-expect --json --force --for "$3" >report 2>errors &
    run=$!
    mend
    finish
    # drives that nobody commands let go
    sleep 0.1
    kill -INT $desk
    wait $desk
    code=$?
    echo "=== ${name}_desk $code"
    cat desk
    echo "--- errors"
    cat desk_errors
    detach
}

# attach: puts the driver of the kernel on the terminal; detach: takes it away again.
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

# Rows of the second: the driver of the kernel for serial adapters, twelve joints, and what `check` says.
serial_rows() {
    mend() { :; }
    slcan slcan '' 2s
    slcan slcan_alone '{ at = "2.5 s", lasts = "300 ms", kind = "alone", bus = "can0" }' 4s
    slcan slcan_passive '{ at = "2.5 s", lasts = "18 ms", kind = "disturbed", bus = "can0" }' 3s
    mend() {
        sleep 3
        ip link set can0 down
        ip link set can0 up
    }
    slcan slcan_bus_off '{ at = "2.5 s", lasts = "300 ms", kind = "bus_off", bus = "can0" }' 5s
    mend() {
        sleep 3
        detach
        attach
    }
    slcan slcan_unplugged '{ at = "2.5 s", lasts = "300 ms", kind = "down", bus = "can0" }' 6s

    graph=/graphs/two-buses.toml
    begin twelve --for "$(cat /graphs/seconds)s"
    finish

    motorium can check /graphs/arm-can.toml --set component.adapter.rate='"1 kHz"' >report 2>errors
    echo "=== saturated $?"
    cat report
    echo "--- errors"
    cat errors
}

"$(cat /graphs/rows)_rows"
