//! Properties of every search.

use super::*;
use crate::random::{Counter, Purpose};
use rand::seq::SliceRandom as _;

/// Evaluates `count` candidates, in the batches proposed by the search.
pub(super) fn rollouts(search: &mut impl Search, count: usize, reward: impl Fn(&[f64]) -> f64) {
    let mut left = count;
    while left > 0 {
        // one point at a time if the method has no generations
        let asked = search.ask(left.min(1));
        assert!(!asked.is_empty(), "a search without generations in flight proposes candidates");
        left -= asked.len();
        let rewards: Vec<(u64, f64)> = asked.iter().map(|c| (c.id, reward(&c.parameters))).collect();
        search.tell(&rewards).expect("known candidates");
    }
}

/// Returns one search of each kind.
fn all(seed: u64) -> Vec<Box<dyn Search>> {
    let start = || Start::new(vec![0.5; 3], vec![1.0; 3], seed).within(vec![[-4.0, 4.0]; 3]);
    let bayesian = BayesianSettings { points: 100, ..BayesianSettings::default() };
    vec![
        Box::new(CmaEs::new(start(), CmaEsSettings::default()).expect("a search")),
        Box::new(SeparableNes::new(start(), NesSettings::default()).expect("a search")),
        Box::new(ExponentialNes::new(start(), NesSettings::default()).expect("a search")),
        Box::new(CrossEntropy::new(start(), CrossEntropySettings::default()).expect("a search")),
        Box::new(
            Power::new(start(), PowerSettings { population: 4, ..Default::default() }).expect("a search"),
        ),
        Box::new(Reps::new(start(), RepsSettings::default()).expect("a search")),
        Box::new(PathIntegral::new(start(), PathIntegralSettings::default()).expect("a search")),
        Box::new(FiniteDifferences::new(start(), FiniteDifferencesSettings::default()).expect("a search")),
        Box::new(BayesianOptimisation::new(vec![[-4.0, 4.0]; 3], bayesian, seed).expect("a search")),
        Box::new(RandomSearch::new(vec![[-4.0, 4.0]; 3], seed).expect("a search")),
    ]
}

fn reward(candidate: &Candidate) -> f64 {
    (-candidate.parameters.iter().map(|x| (x - 1.0) * (x - 1.0)).sum::<f64>()).exp()
}

fn bits(candidates: &[Candidate]) -> Vec<(u64, u64, Vec<u64>)> {
    let numbers = |c: &Candidate| c.parameters.iter().map(|x| x.to_bits()).collect();
    candidates.iter().map(|c| (c.id, c.seed, numbers(c))).collect()
}

/// Runs rounds of a search and reports the rewards together, or shuffled and one by one. Returns the bits of
/// all candidates.
fn run(search: &mut dyn Search, rounds: u64, shuffle: bool) -> Vec<(u64, u64, Vec<u64>)> {
    let mut seen = vec![];
    for round in 0..rounds {
        let asked = search.ask(4);
        seen.extend(bits(&asked));
        let mut rewards: Vec<(u64, f64)> = asked.iter().map(|c| (c.id, reward(c))).collect();
        if shuffle {
            rewards.shuffle(&mut Counter { seed: round, ..Counter::default() }.stream(Purpose::Shuffle));
            rewards.iter().for_each(|reward| search.tell(&[*reward]).expect("a known candidate"));
        } else {
            search.tell(&rewards).expect("known candidates");
        }
    }
    seen
}

#[test]
fn order_of_rewards_does_not_change_results() {
    for (kind, (mut ordered, mut shuffled)) in all(3).into_iter().zip(all(3)).enumerate() {
        let expected = run(ordered.as_mut(), 14, false);
        assert_eq!(run(shuffled.as_mut(), 14, true), expected, "search {kind}");
        assert_eq!(ordered.best(), shuffled.best(), "search {kind}");
        assert!(expected.len() > 14, "search {kind}");
    }
}

#[test]
fn restored_search_continues_bit_for_bit() {
    for (kind, mut straight) in all(5).into_iter().enumerate() {
        run(straight.as_mut(), 9, false);
        // in the middle of a generation
        let asked = straight.ask(3);
        straight.tell(&[(asked[0].id, reward(&asked[0]))]).expect("a known candidate");
        let saved = straight.save();
        let mut restored = all(99).swap_remove(kind);
        restored.restore(&saved).expect("a state of the same kind");
        assert_eq!(restored.best(), straight.best(), "search {kind}");
        assert_eq!(bits(&restored.pending()), bits(&asked[1..]), "search {kind}");
        for search in [&mut straight, &mut restored] {
            for candidate in &asked[1..] {
                search.tell(&[(candidate.id, reward(candidate))]).expect("a known candidate");
            }
        }
        assert_eq!(run(restored.as_mut(), 9, false), run(straight.as_mut(), 9, false), "search {kind}");
        assert_eq!(restored.save(), straight.save(), "search {kind}");
    }
}

#[test]
fn candidates_stay_within_bounds() {
    for (kind, mut search) in all(7).into_iter().enumerate() {
        for _ in 0..20 {
            let asked = search.ask(4);
            let inside = asked.iter().flat_map(|c| &c.parameters).all(|x| (-4.0..=4.0).contains(x));
            assert!(inside, "search {kind}: {asked:?}");
            // the reward keeps increasing beyond the bounds
            let rewards: Vec<(u64, f64)> = asked.iter().map(|c| (c.id, c.parameters[0].exp())).collect();
            search.tell(&rewards).expect("known candidates");
        }
        assert!(search.best().expect("rewards").0[0] > 2.0, "search {kind}: {:?}", search.best());
    }
}

#[test]
fn rewards_of_unknown_candidates_are_refused() {
    for (kind, mut search) in all(1).into_iter().enumerate() {
        let first = search.ask(1).remove(0);
        let unknown = search.tell(&[(first.id, 1.0), (70, 1.0)]).expect_err("candidate 70 does not exist");
        assert_eq!(unknown, TellError::Unknown { id: 70, first: 0, last: 0 }, "search {kind}");
        let repeated = search.tell(&[(0, 1.0), (0, 2.0)]).expect_err("two rewards");
        assert_eq!(repeated, TellError::Repeated { id: 0 }, "search {kind}");
        assert_eq!(search.best(), None, "search {kind}: a refused call records nothing");
        search.tell(&[(0, 1.0)]).expect("a known candidate");
        assert!(search.tell(&[(0, 1.0)]).is_err(), "search {kind}");
        assert_eq!(search.best().expect("a reward").1, 1.0, "search {kind}");
    }
}

#[test]
fn foreign_states_are_refused() {
    let mut searches = all(1);
    let states: Vec<String> = searches.iter().map(|search| search.save()).collect();
    let count = searches.len();
    for (kind, search) in searches.iter_mut().enumerate() {
        let other = search.restore(&states[(kind + 1) % count]).expect_err("another method");
        assert!(matches!(other, RestoreError::Method { .. }), "search {kind}: {other}");
        let broken = search.restore("{").expect_err("not a state");
        assert!(matches!(broken, RestoreError::Parse(_)), "search {kind}: {broken}");
    }
    let start = Start::new(vec![0.0; 2], vec![1.0; 2], 1);
    let mut smaller = CmaEs::new(start, CmaEsSettings::default()).expect("a search");
    let error = smaller.restore(&states[0]).expect_err("three parameters");
    assert_eq!(error, RestoreError::Dimensions { found: 3, expected: 2 });
}

#[test]
fn generations_in_flight_keep_workers_busy() {
    let start = || Start::new(vec![0.0; 2], vec![1.0; 2], 1);
    let settings = CrossEntropySettings { population: 6, ..CrossEntropySettings::default() };
    let mut exact = CrossEntropy::new(start(), settings).expect("a search");
    assert_eq!(exact.ask(100).len(), 6);
    assert!(exact.ask(100).is_empty(), "the generation waits for its rewards");
    let mut ahead = CrossEntropy::new(start(), settings).expect("a search").with_open_generations(2);
    let asked = ahead.ask(100);
    assert_eq!(asked.len(), 12);
    // the second generation ends first, but the updates wait for the first
    let rewards: Vec<(u64, f64)> = asked.iter().rev().map(|c| (c.id, c.parameters[0])).collect();
    ahead.tell(&rewards[..6]).expect("known candidates");
    assert_eq!((ahead.generations(), ahead.mean()), (0, vec![0.0; 2]));
    ahead.tell(&rewards[6..]).expect("known candidates");
    assert_eq!(ahead.generations(), 2);
    assert!(ahead.mean()[0] > 0.0);
}
