//! Tuning of a real robot: the robot runs one episode at a time, and an operator must permit each episode.

use super::dialogue::{Action, AnswerError, Question, Stage};
use super::run::{Progress, Recorder, Subject, Tuning, TuningError};

/// Interface to the person who watches the robot and answers questions.
pub trait Operator {
    /// Asks a question and waits for a line of text. Returns `None` at the end of the input or after an
    /// interruption. The tuning then stops, and no episode begins.
    fn ask(&mut self, question: &Question) -> Option<String>;

    /// Reports an answer that is not one of the choices. The same question is then asked again.
    fn reject(&mut self, error: &AnswerError);
}

/// Reason for the end of an attended tuning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attendance {
    /// All evaluations have been recorded.
    Finished,
    /// The operator stopped the tuning, or the input ended. The next call of [`Tuning::attend`] asks the same
    /// question again.
    Stopped,
}

impl Tuning {
    /// Evaluates the remaining candidates one at a time. The operator permits each episode and judges its
    /// result. `observe` is called after each recorded evaluation.
    ///
    /// The state is saved before each question. A tuning that is stopped, interrupted or killed therefore
    /// asks the same question again, about bitwise the same values. An interrupted episode counts as not run.
    ///
    /// # Errors
    ///
    /// [`TuningError`] if the tuning cannot continue. The folder then contains all evaluations so far.
    pub fn attend<T: Subject>(
        &mut self,
        subject: &T,
        operator: &mut impl Operator,
        mut observe: impl FnMut(Progress<'_>),
    ) -> Result<Attendance, TuningError<T::Error>> {
        let mut worker = subject.worker(0).map_err(TuningError::Subject)?;
        while self.checkpoint.evaluations < self.settings.evaluations {
            let waiting = self.search.pending().into_iter().next();
            let proposed = waiting.or_else(|| self.search.ask(1).into_iter().next());
            let Some(candidate) = proposed else { return Ok(Attendance::Finished) };
            self.checkpoint.search = Some(self.search.save());
            self.save()?;
            let question = self.question(&candidate.parameters);
            let Some(line) = operator.ask(&question) else { return Ok(Attendance::Stopped) };
            let values = question.values;
            match question.stage.answer(&line) {
                Err(error) => operator.reject(&error),
                Ok(Action::Stop) => return Ok(Attendance::Stopped),
                Ok(Action::Propose) => self.checkpoint.attended.stage = Stage::Proposed,
                Ok(Action::Run) => {
                    let result = subject.evaluate(&mut worker, &values, candidate.seed);
                    self.checkpoint.attended.stage = Stage::Ended(result.map_err(TuningError::Subject)?);
                }
                Ok(Action::Record(result)) => {
                    let Self { folder, settings, search, checkpoint } = self;
                    let mut recorder = Recorder::open(folder, settings, checkpoint, search.as_ref())?;
                    search.tell(&[(candidate.id, result.reward)])?;
                    recorder.attended(&values);
                    recorder.record((subject, search.as_ref()), &candidate, &result, &mut observe)?;
                }
            }
        }
        Ok(Attendance::Finished)
    }

    /// The question about a candidate.
    fn question(&self, point: &[f64]) -> Question {
        Question {
            evaluation: self.checkpoint.evaluations + 1,
            evaluations: self.settings.evaluations,
            values: self.settings.values(point),
            last: self.checkpoint.attended.last.clone(),
            best: self.search.best().map(|(_, reward)| reward),
            stage: self.checkpoint.attended.stage.clone(),
        }
    }
}
