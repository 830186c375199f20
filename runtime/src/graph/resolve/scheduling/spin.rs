//! Spin times of the components.

use super::super::activate;
use super::super::draft::Draft;
use super::super::timing::Timing;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::model::RealtimeTable;
use crate::graph::read::{At, good, good_or};
use crate::graph::source::Span;
use crate::graph::values::{Schedule, SpinChoice};
use crate::plan::Spin;
use crate::units::TimeSpan;

/// Returns the spin time of each component: its own, or else the graph's. Components that do not wait for a
/// release time, or are not worth the core time, do not spin.
pub(super) fn spins(
    realtime: Option<&RealtimeTable>,
    drafts: &[Draft<'_, '_>],
    schedules: &[Schedule],
    timing: &Timing,
    report: &mut Report,
) -> Vec<Spin> {
    let graph = realtime.map_or(defaults::SPIN, |table| good_or(&table.spin, defaults::SPIN));
    let share =
        realtime.map_or(defaults::SPIN_SHARE, |table| good_or(&table.spin_share, defaults::SPIN_SHARE));
    if let (Some(table), SpinChoice::Fixed(_)) = (realtime, graph)
        && let (Some(spin), Some(share)) = (&table.spin, &table.spin_share)
        && drafts.iter().all(|draft| good_or(&draft.table.spin, graph) != SpinChoice::Auto)
    {
        report
            .error("`spin_share` only limits an automatic spin time, but this spin time is fixed")
            .label(&share.key, "has no meaning here")
            .and(&spin.span, "a fixed time")
            .advise("leave `spin_share` out, or write `spin = \"auto\"`");
    }
    let whole = realtime.and_then(|table| table.spin.as_ref());
    let spins = (0..drafts.len()).map(|component| {
        let own = drafts[component].table.spin.as_ref();
        if let Some(own) = own {
            has_a_use(&drafts[component], own, schedules[component], report);
        }
        let waits = timing.head[component] == Some(component) && drafts[component].table.activate.is_none();
        let worth = own.is_some() || schedules[component] == Schedule::Fifo;
        let choice = own.map_or(graph, |at| at.get().copied().unwrap_or(graph));
        let period_ns = timing.period_ns(component).filter(|_| waits && worth);
        let Some(period_ns) = period_ns else { return Spin::Fixed { ns: 0 } };
        match choice {
            SpinChoice::Auto => Spin::Tuned { at_most_ns: (period_ns as f64 * share.0) as u64 },
            SpinChoice::Fixed(spin) => {
                if let Some(at) = own.or(whole).filter(|_| spin.ns >= period_ns) {
                    never_sleeps(&drafts[component], &at.span, period_ns, report);
                }
                Spin::Fixed { ns: spin.ns }
            }
        }
    });
    spins.collect()
}

/// Checks an explicit spin time of a component that does not wait for a release time.
fn has_a_use(draft: &Draft<'_, '_>, own: &At<SpinChoice>, schedule: Schedule, report: &mut Report) {
    let nothing = matches!(own.get(), Some(SpinChoice::Fixed(TimeSpan { ns: 0 })));
    if let Some((place, why, label)) = activate::not_by_the_clock(draft) {
        report
            .error(format!(
                "component `{}` must not spin: it has no period, and so no release time to wait for",
                draft.name
            ))
            .label(&own.key, why)
            .and(place, label)
            .advise("leave `spin` out");
    } else if schedule == Schedule::Deadline && !nothing {
        let place = good(&draft.table.schedule).and(draft.table.schedule.as_ref());
        let diagnostic = report
            .error(format!("component `{}` is scheduled by its deadline and must not spin", draft.name))
            .label(&own.span, "spinning would use up its budget in each period")
            .advise("leave `spin` out");
        if let Some(schedule) = place {
            diagnostic.and(&schedule.span, "by its deadline");
        }
    }
}

fn never_sleeps(draft: &Draft<'_, '_>, span: &Span, period_ns: u64, report: &mut Report) {
    report
        .warning(format!("component `{}` never sleeps: it spins until its next step", draft.name))
        .label(span, format!("not shorter than its period of {}", TimeSpan { ns: period_ns }))
        .advise("a shorter `spin` leaves time to other threads; 100 us is enough on most machines");
}
