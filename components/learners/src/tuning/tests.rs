//! Tunings of a function in a folder.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::*;
use crate::search::{Evaluation, Outcome, RestoreError};

/// A function of the plane with a maximum of 0 at (1, 10) and a region without rewards. The tuning ends after
/// a number of evaluations on one thread, as on a signal.
struct Plane {
    stop_at: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Interrupted;

impl Subject for Plane {
    type Worker = u64;
    type Error = Interrupted;

    fn worker(&self, _: usize) -> Result<u64, Interrupted> {
        Ok(0)
    }

    fn evaluate(&self, count: &mut u64, values: &[f64], _: u64) -> Result<Evaluation, Interrupted> {
        *count += 1;
        if *count > self.stop_at {
            return Err(Interrupted);
        }
        let [x, gain] = [values[0], values[1]];
        if x < -1.5 {
            return Ok(Evaluation::failed(Outcome::Unmet, "expected \"height\" > 0.1,\n found 0"));
        }
        Ok(Evaluation::finished(-(x - 1.0).powi(2) - (gain.ln() - 10.0_f64.ln()).powi(2)))
    }

    fn best(&self, values: &[f64], reward: f64) -> Result<String, Interrupted> {
        Ok(format!("# {reward:?}\nx = {:?}\ngain = {:?}\n", values[0], values[1]))
    }
}

const STRAIGHT: Plane = Plane { stop_at: u64::MAX };

fn settings(method: Method) -> Settings {
    let parameters = ["x=-2:3", "gain=0.1:100:log"].map(|text| text.parse().expect("a parameter"));
    Settings { parameters: parameters.into(), method, seed: 5, evaluations: 40, together: 2 }
}

fn create(folder: &Path, method: Method) -> Tuning {
    Tuning::create(folder, settings(method), serde_json::json!("plane")).expect("a tuning")
}

fn file(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).expect(name)
}

const METHODS: [Method; 10] = [
    Method::CmaEs,
    Method::CrossEntropy,
    Method::Snes,
    Method::Xnes,
    Method::Reps,
    Method::PathIntegral,
    Method::Power,
    Method::FiniteDifferences,
    Method::Bayesian,
    Method::Random,
];

#[test]
fn tuning_repeats_on_any_number_of_threads() {
    for method in METHODS {
        let folders = [1, 2, 3].map(|threads| {
            let folder = tempfile::tempdir().expect("a folder");
            let mut tuning = create(folder.path(), method);
            let mut seen = vec![];
            tuning.run(&STRAIGHT, threads, |progress| seen.push(progress.evaluation)).expect("rewards");
            assert_eq!(seen, (1..=40).collect::<Vec<_>>());
            folder
        });
        for name in ["evaluations.csv", "checkpoint.json", "best.toml"] {
            let expected = file(folders[0].path(), name);
            for other in &folders[1..] {
                assert_eq!(file(other.path(), name), expected, "{method:?} {name}");
            }
        }
    }
}

#[test]
fn resumed_tuning_equals_a_straight_one() {
    for method in METHODS {
        let [straight, resumed] = [(), ()].map(|()| tempfile::tempdir().expect("a folder"));
        let mut tuning = create(straight.path(), method);
        tuning.run(&STRAIGHT, 1, |_| {}).expect("rewards");
        let expected = tuning.summary().expect("a table");

        let ended = create(resumed.path(), method).run(&Plane { stop_at: 13 }, 1, |_| {});
        assert!(matches!(ended, Err(TuningError::Subject(Interrupted))), "{ended:?}");
        // a line whose checkpoint was not written
        let table = file(resumed.path(), "evaluations.csv") + "13,finished,99.0,0.0";
        std::fs::write(resumed.path().join("evaluations.csv"), table).expect("a table");
        let (mut tuning, subject) = Tuning::resume(resumed.path()).expect("a tuning");
        assert_eq!((tuning.evaluations(), subject), (13, serde_json::json!("plane")));
        tuning.run(&STRAIGHT, 2, |_| {}).expect("rewards");
        assert_eq!(tuning.summary().expect("a table"), expected, "{method:?}");
        for name in ["evaluations.csv", "checkpoint.json", "best.toml", "tuning.json"] {
            assert_eq!(file(resumed.path(), name), file(straight.path(), name), "{method:?} {name}");
        }
        // a finished tuning has nothing left to do
        let (mut again, _) = Tuning::resume(resumed.path()).expect("a tuning");
        again.run(&STRAIGHT, 2, |_| panic!("an evaluation")).expect("nothing");
        assert_eq!(again.summary().expect("a table"), expected);
    }
}

#[test]
fn failed_evaluations_are_rows_without_reward() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut tuning = create(folder.path(), Method::Random);
    tuning.run(&STRAIGHT, 2, |_| {}).expect("rewards");
    let summary = tuning.summary().expect("a table");
    let failed = summary.outcomes[&Outcome::Unmet];
    assert!(failed > 0 && failed + summary.outcomes[&Outcome::Finished] == 40, "{:?}", summary.outcomes);
    let table = file(folder.path(), "evaluations.csv");
    let mut rows = table.lines();
    assert_eq!(rows.next(), Some("evaluation,outcome,reward,x,gain,reason"));
    let rows: Vec<&str> = rows.collect();
    assert_eq!(rows.len(), 40);
    let unmet: Vec<&&str> = rows.iter().filter(|row| row.contains(",unmet,,")).collect();
    assert_eq!(unmet.len() as u64, failed);
    assert!(unmet[0].ends_with(",\"expected \"\"height\"\" > 0.1, found 0\""), "{}", unmet[0]);
    // the best row equals the summary, and the file of the best parameters has the same numbers
    let number =
        |row: &&str, column: usize| row.split(',').nth(column).and_then(|cell| cell.parse::<f64>().ok());
    let best = rows.iter().max_by(|a, b| {
        let [a, b] = [a, b].map(|row| number(row, 2).unwrap_or(f64::NEG_INFINITY));
        a.total_cmp(&b)
    });
    let best = best.expect("rows");
    let (values, reward) = summary.best.expect("rewards");
    assert_eq!([2, 3, 4].map(|k| number(best, k)), [reward, values[0], values[1]].map(Some));
    let expected = format!("# {reward:?}\nx = {:?}\ngain = {:?}\n", values[0], values[1]);
    assert_eq!(file(folder.path(), "best.toml"), expected);
}

#[test]
fn methods_find_the_maximum() {
    for (method, least) in [(Method::CmaEs, -0.5), (Method::CrossEntropy, -0.5), (Method::Bayesian, -1e-2)] {
        let folder = tempfile::tempdir().expect("a folder");
        let mut tuning = create(folder.path(), method);
        tuning.run(&STRAIGHT, 2, |_| {}).expect("rewards");
        let (values, reward) = tuning.summary().expect("a table").best.expect("rewards");
        assert!(reward > least, "{method:?}: {reward} at {values:?}");
    }
}

#[test]
fn mistakes_in_a_folder_are_distinguished() {
    let folder = tempfile::tempdir().expect("a folder");
    create(folder.path(), Method::CmaEs);
    let again = Tuning::create(folder.path(), settings(Method::CmaEs), serde_json::Value::Null);
    assert!(matches!(again.err(), Some(TuningError::Exists { .. })));
    let other = tempfile::tempdir().expect("a folder");
    let none = Settings { evaluations: 0, ..settings(Method::CmaEs) };
    let refused = Tuning::create(other.path(), none, serde_json::Value::Null).err();
    assert!(matches!(refused, Some(TuningError::Count { what: "evaluations", found: 0 })), "{refused:?}");
    assert!(!Tuning::exists(other.path()));
    assert!(matches!(Tuning::resume(other.path()).err(), Some(TuningError::File(_))));

    let ended = create(other.path(), Method::CmaEs).run(&Plane { stop_at: 3 }, 1, |_| {});
    assert!(ended.is_err());
    let header = "evaluation,outcome,reward,x,gain,reason\n";
    std::fs::write(other.path().join("evaluations.csv"), header).expect("a table");
    let short = Tuning::resume(other.path()).err();
    assert!(matches!(short, Some(TuningError::Table { found: 0, expected: 3, .. })), "{short:?}");
    let changed = file(other.path(), "tuning.json").replace("cma-es", "random");
    std::fs::write(other.path().join("tuning.json"), changed).expect("a description");
    let restored = Tuning::resume(other.path()).err();
    let is_other = |source: &RestoreError| matches!(source, RestoreError::Method { .. });
    assert!(
        matches!(&restored, Some(TuningError::Restore { source, .. }) if is_other(source)),
        "{restored:?}"
    );
    std::fs::write(other.path().join("tuning.json"), "{").expect("a description");
    assert!(matches!(Tuning::resume(other.path()).err(), Some(TuningError::Parse { .. })));
}

#[test]
fn reward_without_a_value_ends_the_tuning_at_once() {
    struct Valueless;
    impl Subject for Valueless {
        type Worker = ();
        type Error = Interrupted;
        fn worker(&self, _: usize) -> Result<(), Interrupted> {
            Ok(())
        }
        fn evaluate(&self, (): &mut (), _: &[f64], _: u64) -> Result<Evaluation, Interrupted> {
            Ok(Evaluation::finished(f64::NAN))
        }
        fn best(&self, _: &[f64], _: f64) -> Result<String, Interrupted> {
            Err(Interrupted)
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let ended = create(folder.path(), Method::Random).run(&Valueless, 2, |_| {});
    assert!(matches!(ended, Err(TuningError::NoReward { .. })), "{ended:?}");
}

/// Operator with prepared answers; the input ends after them.
#[derive(Default)]
struct Script {
    answers: VecDeque<&'static str>,
    /// Every number of the questions, to the bit.
    asked: Vec<String>,
    rejected: Vec<String>,
}

impl Script {
    fn new(answers: impl IntoIterator<Item = &'static str>) -> Self {
        Self { answers: answers.into_iter().collect(), ..Self::default() }
    }
}

impl Operator for Script {
    fn ask(&mut self, question: &Question) -> Option<String> {
        self.asked.push(format!("{question:?}"));
        self.answers.pop_front().map(str::to_owned)
    }

    fn reject(&mut self, error: &AnswerError) {
        self.rejected.push(error.to_string());
    }
}

/// A robot whose episodes end with prepared results, then with rewards equal to their number.
#[derive(Default)]
struct Robot {
    results: Vec<Evaluation>,
    episodes: AtomicU64,
}

impl Robot {
    fn episodes(&self) -> u64 {
        self.episodes.load(Relaxed)
    }
}

impl Subject for Robot {
    type Worker = ();
    type Error = Interrupted;

    fn worker(&self, _: usize) -> Result<(), Interrupted> {
        Ok(())
    }

    fn evaluate(&self, (): &mut (), _: &[f64], _: u64) -> Result<Evaluation, Interrupted> {
        let episode = self.episodes.fetch_add(1, Relaxed);
        let prepared = self.results.get(episode as usize).cloned();
        Ok(prepared.unwrap_or_else(|| Evaluation::finished((episode + 1) as f64)))
    }

    fn best(&self, values: &[f64], reward: f64) -> Result<String, Interrupted> {
        STRAIGHT.best(values, reward)
    }
}

fn short(method: Method, evaluations: u64) -> Settings {
    Settings { evaluations, ..settings(method) }
}

fn attended(folder: &Path, settings: Settings) -> Tuning {
    Tuning::create(folder, settings, serde_json::json!("robot")).expect("a tuning")
}

/// Cells `evaluation`, `outcome` and `reward` of the table.
fn rows(folder: &Path) -> Vec<String> {
    let table = file(folder, "evaluations.csv");
    table.lines().skip(1).map(|row| row.splitn(4, ',').take(3).collect::<Vec<_>>().join(",")).collect()
}

#[test]
fn operator_permits_and_judges_each_episode() {
    let (folder, robot) = (tempfile::tempdir().expect("a folder"), Robot::default());
    let mut tuning = attended(folder.path(), short(Method::Random, 3));
    let mut script =
        Script::new(["run", "repeat", "", "run", "maybe", "accept", "skip", "run", "run", "accept"]);
    let mut seen = vec![];
    let ended =
        tuning.attend(&robot, &mut script, |progress| seen.push((progress.evaluation, progress.best)));
    assert_eq!(ended.expect("rewards"), Attendance::Finished);
    assert_eq!(robot.episodes(), 3);
    assert_eq!(rows(folder.path()), ["0,finished,2.0", "1,skipped,", "2,finished,3.0"]);
    assert_eq!(seen, [(1, Some(2.0)), (2, Some(2.0)), (3, Some(3.0))]);
    let stages: Vec<String> = script
        .asked
        .iter()
        .map(|question| {
            let stage = if question.contains("Proposed") { "run?" } else { "accept?" };
            let number = question.split_once("evaluation: ").and_then(|(_, rest)| rest.split_once(','));
            format!("{} {stage}", number.expect("a number").0)
        })
        .collect();
    let expected =
        "1 run?, 1 accept?, 1 run?, 1 run?, 1 accept?, 1 accept?, 2 run?, 3 run?, 3 accept?, 3 accept?";
    assert_eq!(stages.join(", "), expected);
    let rejected = [
        "found ``, expected run, skip or stop",
        "found `maybe`, expected accept, repeat or stop",
        "found `run`, expected accept, repeat or stop",
    ];
    assert_eq!(script.rejected, rejected);
    // a repeated proposal is the same to the bit
    assert_eq!(script.asked[0], script.asked[2]);
}

#[test]
fn stopped_dialogue_asks_the_same_question_again() {
    // a generation and one more, or the first candidates of a model
    const EVALUATIONS: u64 = 7;
    for method in METHODS {
        let [straight, stopped] = [(), ()].map(|()| tempfile::tempdir().expect("a folder"));
        let answers = || ["run", "accept"].into_iter().cycle().take(2 * EVALUATIONS as usize);
        let mut expected = Script::new(answers());
        let mut tuning = attended(straight.path(), short(method, EVALUATIONS));
        let ended = tuning.attend(&STRAIGHT, &mut expected, |_| {}).expect("rewards");
        assert_eq!((ended, expected.asked.len()), (Attendance::Finished, 2 * EVALUATIONS as usize));

        attended(stopped.path(), short(method, EVALUATIONS));
        let mut asked = vec![];
        let attend = |script: &mut Script| {
            let (mut tuning, _) = Tuning::resume(stopped.path()).expect("a tuning");
            tuning.attend(&STRAIGHT, script, |_| {}).expect("rewards")
        };
        for (index, answer) in answers().enumerate() {
            let mut closed = Script::default();
            assert_eq!(attend(&mut closed), Attendance::Stopped, "{method:?}");
            asked.append(&mut closed.asked);
            let mut one = Script::new([answer, "stop"]);
            attend(&mut one);
            assert_eq!(one.asked[0], asked[index], "{method:?}: question {index}");
        }
        assert_eq!(asked, expected.asked, "{method:?}");
        for name in ["evaluations.csv", "checkpoint.json", "best.toml", "tuning.json"] {
            assert_eq!(file(stopped.path(), name), file(straight.path(), name), "{method:?} {name}");
        }
    }
}

#[test]
fn closed_input_begins_no_episode() {
    let (folder, robot) = (tempfile::tempdir().expect("a folder"), Robot::default());
    let mut tuning = attended(folder.path(), short(Method::CmaEs, 3));
    for answers in [&[][..], &["yes", "", "accept", "r"]] {
        let mut script = Script::new(answers.iter().copied());
        let ended = tuning.attend(&robot, &mut script, |_| {}).expect("no evaluation");
        assert_eq!((ended, script.rejected.len()), (Attendance::Stopped, answers.len()));
    }
    assert_eq!((robot.episodes(), tuning.evaluations()), (0, 0));
}

#[test]
fn interrupted_episode_is_proposed_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut tuning = attended(folder.path(), short(Method::Bayesian, 3));
    let mut before = Script::new(["run", "accept", "run"]);
    // the second episode is interrupted
    let ended = tuning.attend(&Plane { stop_at: 1 }, &mut before, |_| {});
    assert!(matches!(ended, Err(TuningError::Subject(Interrupted))), "{ended:?}");
    let (mut tuning, _) = Tuning::resume(folder.path()).expect("a tuning");
    assert_eq!(tuning.evaluations(), 1);
    let mut after = Script::default();
    tuning.attend(&STRAIGHT, &mut after, |_| {}).expect("no evaluation");
    assert_eq!(after.asked.last(), before.asked.last());
}

#[test]
fn safe_stop_is_repeated_or_skipped_but_never_counts() {
    let stopped = || Evaluation::failed(Outcome::Stopped, "safe stop: `drives` ended");
    let folder = tempfile::tempdir().expect("a folder");
    let robot = Robot { results: vec![stopped(), stopped()], ..Robot::default() };
    let mut tuning = attended(folder.path(), short(Method::Power, 2));
    let mut script =
        Script::new(["run", "accept", "1.0", "repeat", "run", "repeat", "skip", "run", "accept"]);
    tuning.attend(&robot, &mut script, |_| {}).expect("rewards");
    assert_eq!(script.rejected.len(), 2, "{:?}", script.rejected);
    assert!(script.asked[1].contains("`drives` ended"), "{}", script.asked[1]);
    assert_eq!(rows(folder.path()), ["0,skipped,", "1,finished,3.0"]);
    let summary = tuning.summary().expect("a table");
    assert_eq!(summary.outcomes, [(Outcome::Finished, 1), (Outcome::Skipped, 1)].into());
    assert_eq!(summary.best.map(|(_, reward)| reward), Some(3.0));
}

#[test]
fn operator_enters_rewards_that_are_not_measured() {
    let folder = tempfile::tempdir().expect("a folder");
    let robot = Robot { results: vec![Evaluation::unscored(); 3], ..Robot::default() };
    let mut tuning = attended(folder.path(), short(Method::Snes, 2));
    let mut script = Script::new(["run", "accept", "-1.5", "run", "inf", "stop"]);
    tuning.attend(&robot, &mut script, |_| {}).expect("rewards");
    assert_eq!(script.rejected.len(), 2, "{:?}", script.rejected);
    let (mut tuning, _) = Tuning::resume(folder.path()).expect("a tuning");
    // the episode before the stop is judged, not run again
    tuning.attend(&robot, &mut Script::new(["2.5"]), |_| {}).expect("rewards");
    assert_eq!(robot.episodes(), 2);
    assert_eq!(rows(folder.path()), ["0,finished,-1.5", "1,finished,2.5"]);
}
