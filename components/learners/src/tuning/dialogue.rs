//! Questions to the operator of a robot: a state machine without input or output.

use serde::{Deserialize, Serialize};

use crate::search::{Evaluation, Outcome};

/// Stage of the evaluation of a candidate on a robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// The candidate waits for permission: no episode has run, or the last episode was discarded.
    #[default]
    Proposed,
    /// An episode has ended, and its result waits for the operator's judgement.
    Ended(Evaluation),
}

/// A question to the operator, who can see the robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// Number of the evaluation, counted from 1.
    pub evaluation: u64,
    /// Total number of evaluations of the tuning.
    pub evaluations: u64,
    /// Proposed values of the parameters.
    pub values: Vec<f64>,
    /// Values of the previous evaluation; `None` for the first evaluation.
    pub last: Option<Vec<f64>>,
    /// Best reward so far; `None` while all evaluations failed.
    pub best: Option<f64>,
    /// Stage of the candidate, which determines the valid [`choices`](Stage::choices).
    pub stage: Stage,
}

/// Action that follows from an answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Runs an episode. The stage is then [`Stage::Ended`].
    Run,
    /// Records a result of the candidate and proposes the next candidate.
    Record(Evaluation),
    /// Discards the result and proposes the same values again.
    Propose,
    /// Stops the tuning. The same question is asked when the tuning is resumed.
    Stop,
}

/// Error of an answer that is not one of the choices.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found `{found}`, expected {expected}")]
pub struct AnswerError {
    /// Text found.
    pub found: String,
    /// Valid choices.
    pub expected: &'static str,
}

impl Stage {
    /// Returns a text that lists the valid answers in this stage.
    ///
    /// A result can be accepted if it has a reward, if a condition of success is not met, or if the values
    /// were refused. After a safe stop, a failed run or a reward without a value, there is nothing to accept.
    pub fn choices(&self) -> &'static str {
        match self {
            Self::Proposed => "run, skip or stop",
            Self::Ended(result) => match result.outcome {
                Outcome::Finished | Outcome::Unmet | Outcome::Refused => "accept, repeat or stop",
                Outcome::Unscored => "the reward, repeat or stop",
                Outcome::Stopped | Outcome::NoValue | Outcome::Skipped => "repeat or stop",
            },
        }
    }

    /// Returns the action that follows from an answer. Only whole words count, so that a stray key cannot
    /// move a robot.
    ///
    /// # Errors
    ///
    /// [`AnswerError`] for any text that is not one of the [`choices`](Self::choices), such as an empty line.
    pub fn answer(&self, line: &str) -> Result<Action, AnswerError> {
        let word = line.trim();
        let action = match self {
            _ if word == "stop" => Some(Action::Stop),
            Self::Proposed => match word {
                "run" => Some(Action::Run),
                "skip" => {
                    let skipped = Evaluation::failed(Outcome::Skipped, "skipped by the operator");
                    Some(Action::Record(skipped))
                }
                _ => None,
            },
            Self::Ended(_) if word == "repeat" => Some(Action::Propose),
            Self::Ended(result) => match result.outcome {
                Outcome::Finished | Outcome::Unmet | Outcome::Refused => {
                    (word == "accept").then(|| Action::Record(result.clone()))
                }
                Outcome::Unscored => {
                    let reward = word.parse::<f64>().ok().filter(|reward| reward.is_finite());
                    reward.map(|reward| Action::Record(Evaluation::finished(reward)))
                }
                Outcome::Stopped | Outcome::NoValue | Outcome::Skipped => None,
            },
        };
        action.ok_or_else(|| AnswerError { found: word.to_owned(), expected: self.choices() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_word_run_permits_an_episode() {
        let answer = |line| Stage::Proposed.answer(line);
        assert_eq!((answer("run"), answer(" run\r\n")), (Ok(Action::Run), Ok(Action::Run)));
        for line in ["", "\n", "r", "y", "yes", "RUN!", "run run", "accept", "repeat", "1.5", "run\0"] {
            let error = answer(line).expect_err("not a choice");
            assert_eq!((error.found.as_str(), error.expected), (line.trim(), "run, skip or stop"));
        }
        assert_eq!(answer("stop"), Ok(Action::Stop));
        let Ok(Action::Record(skipped)) = answer("skip") else { panic!("a skipped evaluation") };
        assert!(skipped.outcome == Outcome::Skipped && skipped.reward.is_nan());
    }

    #[test]
    fn failed_episodes_cannot_be_accepted() {
        for outcome in Outcome::ALL {
            let stage = Stage::Ended(Evaluation { outcome, reward: f64::NAN, reason: None });
            let may_count = matches!(outcome, Outcome::Finished | Outcome::Unmet | Outcome::Refused);
            assert_eq!(stage.answer("accept").is_ok(), may_count, "{outcome:?}");
            assert_eq!(stage.choices().contains("accept"), may_count, "{outcome:?}");
            assert_eq!(stage.answer("0.5").is_ok(), outcome == Outcome::Unscored, "{outcome:?}");
            // the next episode needs a permission of its own
            assert_eq!(stage.answer("repeat"), Ok(Action::Propose));
            assert_eq!(stage.answer("stop"), Ok(Action::Stop));
            for line in ["run", "skip", ""] {
                assert!(stage.answer(line).is_err(), "{outcome:?}: {line}");
            }
        }
    }

    #[test]
    fn entered_rewards_are_finite_numbers() {
        let stage = Stage::Ended(Evaluation::unscored());
        assert_eq!(stage.answer("-2.5e-1"), Ok(Action::Record(Evaluation::finished(-0.25))));
        for line in ["nan", "inf", "1,5", "one"] {
            assert!(stage.answer(line).is_err(), "{line}");
        }
    }

    #[test]
    fn stages_are_stored_to_the_bit() {
        let stopped = Evaluation::failed(Outcome::Stopped, "`drives` ended");
        for result in [Evaluation::finished(0.1 + 0.2), stopped, Evaluation::unscored()] {
            let text = serde_json::to_string(&Stage::Ended(result.clone())).expect("numbers and texts");
            let Stage::Ended(read) = serde_json::from_str(&text).expect(&text) else { panic!("{text}") };
            assert_eq!((read.outcome, &read.reason), (result.outcome, &result.reason));
            assert_eq!(read.reward.to_bits(), result.reward.to_bits(), "{text}");
        }
    }
}
