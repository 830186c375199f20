//! Default priorities and cores.

/// Returns rate-monotonic priorities: the shorter the period, the higher the priority (C. Liu, J. Layland
/// 1973). Equal periods get equal priorities.
///
/// The fastest rate gets the priority `fastest`, and each slower rate gets a priority lower by `step` than
/// the next faster rate. If the lowest priority would be below 1, smaller steps are used. Neighbouring rates
/// share a priority only if there are more than `fastest` rates.
pub fn rate_monotonic(periods_ns: &[u64], fastest: u8, step: u8) -> Vec<u8> {
    let mut rates = periods_ns.to_vec();
    rates.sort_unstable();
    rates.dedup();
    let last = rates.len().saturating_sub(1).max(1);
    let room = usize::from(fastest.saturating_sub(1));
    periods_ns
        .iter()
        .map(|period| {
            // every period is among them
            let rank = rates.binary_search(period).unwrap_or(0);
            let below = (rank * usize::from(step)).min(rank * room / last);
            fastest.saturating_sub(u8::try_from(below).unwrap_or(u8::MAX)).max(1)
        })
        .collect()
}

/// A chain of components that trigger one another, reduced to the data that determine its core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainLoad {
    /// Fraction of a core that the chain uses, the sum of budgets divided by the period; 0 if the budgets are
    /// unknown.
    pub share: f64,
    /// Core that the graph assigns to the chain; `None` to choose one.
    pub core: Option<usize>,
}

/// Returns a core for each chain, in the order of `chains`. All components of a chain get the same core,
/// because waking the next component on the same core is several times cheaper than on another core.
///
/// Chains with a given core are placed first. The remaining chains are then placed on the real-time cores:
/// the chain with the largest load first, each on the least loaded core (worst fit, decreasing). Among
/// equally loaded cores, the core with fewer chains is chosen, then the core listed first in `realtime`.
/// `realtime` must not be empty.
pub fn cores(chains: &[ChainLoad], realtime: &[usize]) -> Vec<usize> {
    let mut loads: Vec<(f64, usize)> = realtime
        .iter()
        .map(|core| {
            let here = chains.iter().filter(|chain| chain.core == Some(*core));
            (here.clone().map(|chain| chain.share).sum(), here.count())
        })
        .collect();
    let mut placed: Vec<Option<usize>> = chains.iter().map(|chain| chain.core).collect();
    let mut open: Vec<usize> = (0..chains.len()).filter(|chain| chains[*chain].core.is_none()).collect();
    open.sort_by(|a, b| chains[*b].share.total_cmp(&chains[*a].share));
    for chain in open {
        let least = (0..loads.len()).min_by(|a, b| {
            let ((a_share, a_count), (b_share, b_count)) = (loads[*a], loads[*b]);
            a_share.total_cmp(&b_share).then(a_count.cmp(&b_count))
        });
        let Some(least) = least else { continue };
        loads[least].0 += chains[chain].share;
        loads[least].1 += 1;
        placed[chain] = Some(realtime[least]);
    }
    placed.into_iter().map(|core| core.unwrap_or(0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faster_rates_are_more_urgent_and_equal_rates_equal() {
        assert_eq!(rate_monotonic(&[1_000, 250, 1_000, 10_000], 80, 5), [75, 80, 75, 70]);
        assert_eq!(rate_monotonic(&[7], 80, 5), [80]);
        assert!(rate_monotonic(&[], 80, 5).is_empty());
    }

    #[test]
    fn many_rates_keep_distinct_priorities() {
        let periods: Vec<u64> = (1..=80).collect();
        let priorities = rate_monotonic(&periods, 80, 5);
        assert_eq!((priorities[0], priorities[79]), (80, 1));
        assert!(priorities.windows(2).all(|pair| pair[0] > pair[1]), "{priorities:?}");
    }

    #[test]
    fn slower_rate_never_gets_a_higher_priority() {
        let periods: Vec<u64> = (1..=300).collect();
        let priorities = rate_monotonic(&periods, 80, 5);
        assert!(priorities.windows(2).all(|pair| pair[0] >= pair[1]));
        assert_eq!((priorities[0], priorities[299]), (80, 1));
    }

    fn chain(share: f64, core: Option<usize>) -> ChainLoad {
        ChainLoad { share, core }
    }

    #[test]
    fn chains_spread_over_the_real_time_cores() {
        let chains = [chain(0.1, None), chain(0.6, None), chain(0.3, None), chain(0.3, None)];
        assert_eq!(cores(&chains, &[2, 3]), [2, 2, 3, 3]);
    }

    #[test]
    fn given_core_is_kept_and_counted() {
        let chains = [chain(0.5, Some(3)), chain(0.1, None), chain(0.1, Some(0))];
        assert_eq!(cores(&chains, &[3, 2]), [3, 2, 0]);
    }

    #[test]
    fn chains_of_unknown_load_are_spread_by_number() {
        assert_eq!(cores(&[chain(0.0, None); 4], &[1, 2]), [1, 2, 1, 2]);
        assert_eq!(cores(&[chain(0.0, None); 2], &[1]), [1, 1]);
    }
}
