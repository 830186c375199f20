//! The machine: physical or virtual, cores, frequency scaling, idle states.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::time::Duration;

use motorium::os::IdleLimit;
use motorium::os::machine::{governor, is_virtual, isolated_cores, online_cores, tickless_cores};

use super::finding::Finding;
use super::read;

pub(super) fn check() -> Vec<Finding> {
    let governors: Vec<String> = online_cores().into_iter().filter_map(governor).collect();
    vec![
        check_virtual(
            is_virtual(),
            &[read("/sys/class/dmi/id/sys_vendor"), read("/sys/class/dmi/id/product_name")]
                .map(Option::unwrap_or_default),
            ["/.dockerenv", "/run/.containerenv", "/run/systemd/container"]
                .iter()
                .any(|file| Path::new(file).exists()),
        ),
        check_cores(&online_cores(), &isolated_cores(), &tickless_cores()),
        check_siblings(read("/sys/devices/system/cpu/smt/active").as_deref()),
        check_governors(&governors),
        check_idle(
            &idle_states(Path::new("/sys/devices/system/cpu/cpu0/cpuidle")),
            latency_limit(),
            IdleLimit::hold(Duration::from_secs(1)).is_ok(),
        ),
    ]
}

fn check_virtual(hypervisor: bool, product: &[String; 2], container: bool) -> Finding {
    let name = "machine";
    let inside = if container { ", in a container" } else { "" };
    if hypervisor {
        let product = product.join(" ");
        let product = product.trim();
        let kind = if product.is_empty() { String::new() } else { format!(" ({product})") };
        let found = format!(
            "virtual{kind}{inside}: its host may take the cores away at any time; the measurements below \
             are not the hardware's"
        );
        return Finding::warn(name, found, "run robots on a physical machine; for development this is fine");
    }
    Finding::pass(name, format!("not virtual{inside}"))
}

fn check_cores(online: &[usize], isolated: &[usize], tickless: &[usize]) -> Finding {
    let name = "cores";
    let Some(last) = online.last() else {
        return Finding::warn(name, "cannot be counted", "is /sys mounted?");
    };
    if online.len() == 1 {
        let found = "1: real-time components share it with everything else";
        return Finding::warn(name, found, "use a machine with at least 2 cores");
    }
    if isolated.is_empty() {
        let found =
            format!("{}, none isolated: the system may put other work on the real-time core", online.len());
        let fix = format!("boot with isolcpus={last} nohz_full={last} rcu_nocbs={last} irqaffinity=0");
        return Finding::warn(name, found, fix);
    }
    let list = |cores: &[usize]| cores.iter().map(usize::to_string).collect::<Vec<_>>().join(",");
    let tick = if isolated.iter().all(|core| tickless.contains(core)) { ", without tick" } else { "" };
    let advice = "name the isolated ones in the graph: [cores] realtime";
    Finding::pass(name, format!("{}, isolated {}{tick} ({advice})", online.len(), list(isolated)))
}

fn check_siblings(active: Option<&str>) -> Finding {
    let name = "hyper-threads";
    match active {
        Some("1") => Finding::warn(
            name,
            "on: load on the sibling of a real-time core slows it down",
            "echo off | sudo tee /sys/devices/system/cpu/smt/control",
        ),
        _ => Finding::pass(name, "none in use"),
    }
}

fn check_governors(governors: &[String]) -> Finding {
    let name = "governor";
    let slow: Vec<&str> =
        governors.iter().map(String::as_str).filter(|governor| *governor != "performance").collect();
    match slow.first() {
        None if governors.is_empty() => Finding::pass(name, "the system does not scale the frequency"),
        None => Finding::pass(name, "performance"),
        Some(governor) => {
            let found = format!("{governor} on {} cores: they may be slow when a step begins", slow.len());
            let fix = "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor";
            Finding::warn(name, found, fix)
        }
    }
}

/// An enabled idle state of a core.
#[derive(Debug, Clone, PartialEq, Eq)]
struct IdleState {
    name: String,
    /// Exit latency, us.
    latency_us: u64,
}

fn idle_states(folder: &Path) -> Vec<IdleState> {
    let mut states = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let value = |file: &str| read(&entry.path().join(file).to_string_lossy());
        let (Some(name), Some(latency)) = (value("name"), value("latency")) else { continue };
        if value("disable").as_deref() != Some("1") {
            states.push(IdleState { name, latency_us: latency.parse().unwrap_or(0) });
        }
    }
    states
}

/// Returns the limit on the exit latency of idle states set through `/dev/cpu_dma_latency`, us.
fn latency_limit() -> Option<u64> {
    let mut bytes = [0; 4];
    // Opening the file requests nothing; only writing does.
    File::open("/dev/cpu_dma_latency").ok()?.read_exact(&mut bytes).ok()?;
    u64::try_from(i32::from_ne_bytes(bytes)).ok()
}

/// Checks the idle states. `may_limit` is `true` if this user may restrict idle states, as running graphs do.
fn check_idle(states: &[IdleState], limit_us: Option<u64>, may_limit: bool) -> Finding {
    let name = "idle states";
    let allowed = states.iter().filter(|state| limit_us.is_none_or(|limit| state.latency_us <= limit));
    let limit = match limit_us {
        Some(limit) if limit < 1_000_000 => format!("; cpu_dma_latency is held at {limit} us"),
        Some(_) => "; cpu_dma_latency limits nothing".to_string(),
        None => "; cpu_dma_latency cannot be read as this user".to_string(),
    };
    let Some(deepest) = allowed.max_by_key(|state| state.latency_us) else {
        return Finding::pass(name, format!("none is enabled{limit}"));
    };
    let found = format!("the deepest, {}, takes {} us to leave{limit}", deepest.name, deepest.latency_us);
    if deepest.latency_us <= 20 {
        return Finding::pass(name, found);
    }
    if may_limit {
        return Finding::pass(name, format!("{found}; graphs keep the cores out of it while they run"));
    }
    let fix = "as root, or echo 'KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", MODE=\"0660\"' | sudo tee \
               /etc/udev/rules.d/90-motorium.rules   (graphs then keep the cores out of it while they run)";
    Finding::warn(name, found, fix)
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;

    #[test]
    fn hypervisor_is_a_warning_with_its_name_if_known() {
        let named = check_virtual(true, &["QEMU".into(), "Standard PC".into()], false);
        assert_eq!(named.verdict, Verdict::Warn);
        assert!(named.found.starts_with("virtual (QEMU Standard PC):"), "{}", named.found);
        let container = check_virtual(true, &[String::new(), String::new()], true);
        assert!(container.found.starts_with("virtual, in a container:"), "{}", container.found);
        let real = check_virtual(false, &["Dell".into(), "XPS".into()], false);
        assert_eq!(real, Finding::pass("machine", "not virtual"));
    }

    #[test]
    fn doctor_proposes_the_last_core_without_isolation() {
        let finding = check_cores(&[0, 1, 2, 3], &[], &[]);
        assert_eq!(finding.verdict, Verdict::Warn);
        assert_eq!(finding.fix.unwrap(), "boot with isolcpus=3 nohz_full=3 rcu_nocbs=3 irqaffinity=0");
        let isolated = check_cores(&[0, 1, 2, 3], &[2, 3], &[2, 3]);
        assert_eq!(isolated.verdict, Verdict::Pass);
        assert!(isolated.found.contains("isolated 2,3, without tick"), "{}", isolated.found);
        assert_eq!(check_cores(&[0], &[], &[]).verdict, Verdict::Warn);
    }

    #[test]
    fn one_slow_core_causes_a_warning() {
        let governors = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(check_governors(&governors(&["performance", "performance"])).verdict, Verdict::Pass);
        let mixed = check_governors(&governors(&["performance", "powersave"]));
        assert_eq!(mixed.verdict, Verdict::Warn);
        assert!(mixed.found.contains("powersave on 1 cores"), "{}", mixed.found);
        assert_eq!(check_governors(&[]).verdict, Verdict::Pass);
    }

    #[test]
    fn deep_idle_states_warn_unless_forbidden() {
        let states = [("POLL", 0), ("C1", 2), ("C6", 133)]
            .map(|(name, latency_us)| IdleState { name: name.into(), latency_us });
        let free = check_idle(&states, Some(2_000_000_000), false);
        assert_eq!(free.verdict, Verdict::Warn);
        assert!(free.found.contains("C6") && free.fix.unwrap().contains("cpu_dma_latency"));
        assert_eq!(check_idle(&states, Some(2_000_000_000), true).verdict, Verdict::Pass);
        assert_eq!(check_idle(&states, Some(0), false).verdict, Verdict::Pass);
        assert_eq!(check_idle(&states[..2], None, false).verdict, Verdict::Pass);
        assert_eq!(check_idle(&[], None, false).verdict, Verdict::Pass);
    }

    #[test]
    fn disabled_idle_states_are_ignored() {
        let folder = tempfile::tempdir().unwrap();
        for (state, name, latency, disable) in [("state0", "C1", "2", "0"), ("state1", "C6", "133", "1")] {
            let path = folder.path().join(state);
            std::fs::create_dir(&path).unwrap();
            for (file, text) in [("name", name), ("latency", latency), ("disable", disable)] {
                std::fs::write(path.join(file), format!("{text}\n")).unwrap();
            }
        }
        assert_eq!(idle_states(folder.path()), [IdleState { name: "C1".into(), latency_us: 2 }]);
    }
}
