#!/usr/bin/env bash
# Runs a shell script under a Linux kernel that has CAN, in a virtual machine: no root, nothing installed.
#
#   vm.sh [--memory MB] [--put FILE[:PLACE]]... SCRIPT
#
# The machine has the virtual CAN interfaces vcan0 and vcan1, and one processor whose time is virtual: an instruction takes a
# nanosecond, and idle time none. The load of the host then has no effect, and no measurement is a speed.
# SCRIPT is run by sh with its standard output and error; programs among the files bring their libraries
# along. The exit code is SCRIPT's; 124 after the time limit; 125, with a reason, if no machine is available.
#
# The machine ends with the program that started this script, even if that is killed.
#
# Needs Debian's apt-get, dpkg-deb and xz. The kernel and, if missing, the emulator are downloaded once, about
# 90 MB, into $MOTORIUM_VM_CACHE, by default ~/.cache/motorium-vm.
set -euo pipefail

cache=${MOTORIUM_VM_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/motorium-vm}
memory=2048 limit=${MOTORIUM_VM_SECONDS:-1500} files=()
cannot() { echo "no virtual machine: $*" >&2; exit 125; }
while [[ ${1-} == --* ]]; do
    case $1 in
        --memory) memory=$2 ;;
        --put) files+=("$2") ;;
        *) cannot "unknown option $1" ;;
    esac
    shift 2
done
script=${1:?the script to run}

for tool in apt-get dpkg-deb xz ldd; do
    command -v "$tool" >/dev/null || cannot "\`$tool\` is missing"
done
[[ $(uname -m) == x86_64 ]] || cannot "the kernel is one for x86_64"

# Downloads packages and unpacks them into a folder of the cache, once.
unpacked() {
    local folder=$cache/$1 scratch package
    shift
    [[ -e $folder ]] && return
    scratch=$(mktemp -d "$cache/new.XXXXXX")
    (cd "$scratch" && apt-get -qq -o APT::Sandbox::User=root download "$@" >/dev/null 2>&1) \
        || { rm -rf "$scratch"; return 1; }
    mkdir "$scratch/root"
    for package in "$scratch"/*.deb; do dpkg-deb -x "$package" "$scratch/root"; done
    mv -T "$scratch/root" "$folder"
    rm -rf "$scratch"
}
fetched() { unpacked "$@" || { apt-get -qq update >/dev/null 2>&1 && unpacked "$@"; } || cannot "cannot download ${*:2}"; }

mkdir -p "$cache"
exec 9>"$cache/lock"
flock 9
if command -v qemu-system-x86_64 >/dev/null; then
    emulator=(qemu-system-x86_64)
else
    fetched emulator qemu-system-x86 qemu-system-common qemu-system-data seabios ipxe-qemu libcapstone4 libfdt1 \
        libpmem1 librdmacm1 libibverbs1 libslirp0 libvdeplug2 libnl-3-200 libnl-route-3-200 libndctl6 libdaxctl1
    root=$cache/emulator libraries=$cache/emulator/usr/lib/x86_64-linux-gnu
    emulator=(env "LD_LIBRARY_PATH=$libraries:$root/lib/x86_64-linux-gnu" "QEMU_MODULE_DIR=$libraries/qemu"
        "$root/usr/bin/qemu-system-x86_64" -L "$root/usr/share/qemu" -L "$root/usr/share/seabios")
fi
fetched busybox busybox-static
busybox=$cache/busybox/bin/busybox
if [[ ! -e $cache/kernel.name ]]; then
    name() { apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: \(linux-image-[0-9].*\)/\1/p' | head -1; }
    found=$(name)
    [[ $found ]] || { apt-get -qq update >/dev/null 2>&1 || true; found=$(name); }
    [[ $found ]] || cannot "there is no package of a kernel"
    echo "$found" >"$cache/kernel.name"
fi
kernel=$(<"$cache/kernel.name")
fetched kernel "$kernel"
# An uncompressed kernel starts seconds sooner: unpacking it under emulation is slow.
image=$cache/vmlinux
if [[ ! -e $image ]]; then
    packed=$(echo "$cache"/kernel/boot/vmlinuz-*)
    for offset in $(LC_ALL=C grep -aboP '\xfd7zXZ\x00' "$packed" | cut -d: -f1); do
        tail -c+$((offset + 1)) "$packed" | xz -dc 2>/dev/null >"$image.new" || true
        [[ $(head -c4 "$image.new" | tail -c3) == ELF ]] && { mv "$image.new" "$image"; break; }
    done
    [[ -e $image ]] || cp "$packed" "$image"
fi
flock -u 9

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
root=$work/root
mkdir -p "$root"/{bin,dev,proc,sys,tmp,etc,modules,lib64}
cp "$busybox" "$root/bin/busybox"
echo 'root:x:0:0:root:/:/bin/sh' >"$root/etc/passwd"
modules="can can-dev can-raw vcan slcan"
for module in $modules; do
    found=$(find "$cache/kernel/lib/modules" -name "$module.ko*" | head -1)
    case $found in
        *.xz) xz -dc "$found" >"$root/modules/$module.ko" ;;
        ?*) cp "$found" "$root/modules/$module.ko" ;;
    esac
done
put() {
    local source=$1 place=$2 library
    mkdir -p "$root$(dirname "$place")"
    cp -rL "$source" "$root$place"
    [[ -f $source && $(head -c4 "$source" | tail -c3) == ELF ]] || return 0
    strip "$root$place" 2>/dev/null || true
    for library in $(ldd "$source" | grep -oE '/[^ ]+'); do
        [[ -e $root$library ]] || { mkdir -p "$root$(dirname "$library")"; cp -L "$library" "$root$library"; }
    done
}
for file in ${files[@]+"${files[@]}"}; do put "${file%%:*}" "${file#*:}"; done
cp "$script" "$root/script"
cat >"$root/init" <<INIT
#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/bin HOME=/tmp TERM=dumb
mount -t devtmpfs dev /dev; mount -t proc proc /proc; mount -t sysfs sys /sys
mkdir -p /dev/shm /dev/pts; mount -t tmpfs -o mode=1777 shm /dev/shm; mount -t devpts devpts /dev/pts; chmod 1777 /tmp
for line in 1 2 3; do stty -F /dev/ttyS\$line raw -echo; done
for module in $modules; do [ -e /modules/\$module.ko ] && insmod /modules/\$module.ko; done
echo -1 >/proc/sys/kernel/sched_rt_runtime_us
ip link set lo up
for bus in vcan0 vcan1; do ip link add \$bus type vcan; ip link set \$bus mtu 72; ip link set \$bus up; done
cd /tmp
sh /script >/dev/ttyS1 2>/dev/ttyS2 </dev/null
echo "code \$?" >/dev/ttyS3
sync
poweroff -f
INIT
chmod +x "$root/init"
(cd "$root" && find . | LC_ALL=C sort | "$busybox" cpio -o -H newc 2>/dev/null) >"$work/files"

touch "$work/out" "$work/errors" "$work/code"
# A repetition prefix is emulated byte by byte here, and each further level of page tables is walked: without them the kernel and the C
# library take loops that are emulated faster.
machine=(-M q35 -cpu max,-erms,-fsrm,-la57,-smap -smp 1 -m "$memory" -nodefaults -no-user-config -no-reboot -display none
    -bios qboot.rom -kernel "$image" -initrd "$work/files" -accel tcg
    -icount shift=0,sleep=off -rtc base=2026-01-01,clock=vm -seed 1
    -serial "file:$work/console" -serial "file:$work/out" -serial "file:$work/errors" -serial "file:$work/code")
arguments="console=ttyS0 quiet panic=-1 tsc=reliable nokaslr nolapic_timer random.trust_cpu=on cryptomgr.notests=1 mitigations=off"
"${emulator[@]}" "${machine[@]}" -append "$arguments" </dev/null >"$work/emulator" 2>&1 &
emulator_pid=$!
trap 'kill -9 "$emulator_pid" 2>/dev/null || true; rm -rf "$work"' EXIT
trap 'exit 143' TERM
trap 'exit 130' INT
trap 'exit 129' HUP
# The machine ends with its time limit, with the program that started this script, and with this script,
# however they end.
watch() {
    local end=$((SECONDS + limit)) state parent
    while kill -0 "$emulator_pid" 2>/dev/null; do
        read -r _ _ state parent _ <"/proc/$$/stat" 2>/dev/null || break
        [[ $state == Z || $parent != "$PPID" ]] && break
        ((SECONDS < end)) || { : >"$work/late"; break; }
        sleep 0.5
    done
    kill -9 "$emulator_pid" 2>/dev/null || true
    # nothing else removes it if the script is killed
    [[ -e /proc/$$ ]] || rm -rf "$work"
}
watch </dev/null >/dev/null 2>&1 &
# its output is forwarded immediately
tail -c +1 -f -s 0.1 --pid="$emulator_pid" "$work/out" 2>/dev/null &
passing=$!
status=0
wait "$emulator_pid" || status=$?
wait "$passing" || true
cat "$work/errors" >&2
code=$(sed -n 's/^code \([0-9]*\).*/\1/p' "$work/code")
[[ $code ]] && exit "$code"
[[ -e $work/late ]] && { echo "no end within $limit s" >&2; exit 124; }
tail -n 20 "$work/console" "$work/emulator" >&2 || true
cannot "it ended without a result ($status)"
