//! Transcripts of foreign egos: percepts in, commands out, for a sample of episodes.
//!
//! A program or a controller of yours may keep state over `reset`. Its commands then
//! depend on earlier episodes, and no rate is about the ego that it names. The sample is
//! played again against fresh egos ([`super::repeatability`]). It prefers episodes in
//! which kept state shows: the latest, those after a near miss, and hard ones.

use std::collections::{BTreeSet, VecDeque};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::unrepeatable::Unrepeatable;
use crate::ego::{Briefing, Command, Controller, Fault, Percept};

/// Latest episodes in the sample. Neighbours reveal egos that alternate.
const LATEST: usize = 4;
/// Episodes in the sample for each kind of hard episode.
const HARD: usize = 4;
/// First episodes in the sample, which reveal state outside the ego, such as files.
const FIRST: usize = 2;
/// Episodes in the sample that are scattered over the life of the ego.
const SCATTERED: usize = 12;
/// Most road users in a transcript, over all its steps. The rest of an episode is left out.
const MOST_SEEN: usize = 20_000;
/// Lateral room beside both bodies within which a road user is in the way.
const BESIDE_M: f64 = 0.5;

/// Creates a fresh controller that shares no state with earlier ones.
pub type Maker = Arc<dyn Fn() -> Box<dyn Controller> + Send + Sync>;

/// An episode as the ego saw it, with its commands.
#[derive(Clone, Debug, Default)]
pub struct Transcript {
    /// Seed of the episode.
    pub seed: u64,
    /// Position among all episodes of the ego, from 0.
    pub(super) number: u64,
    pub(super) briefing: Option<Briefing>,
    pub(super) steps: Vec<(Percept, Command)>,
    /// Later pieces of road, each before the step of its number.
    pub(super) briefings: Vec<(usize, Briefing)>,
}

/// Difficulty of an episode.
#[derive(Clone, Copy, Debug)]
struct Hardness {
    /// Smallest gap to a road user ahead in the own path.
    gap_m: f64,
    /// Strongest commanded braking.
    braking_mps2: f64,
}

impl Hardness {
    const NONE: Hardness = Hardness {
        gap_m: f64::INFINITY,
        braking_mps2: 0.0,
    };

    fn note(&mut self, percept: &Percept, command: Command) {
        let own = &percept.own;
        for seen in &percept.others {
            // Traffic in another lane passes close by without being hard.
            let room_m = (seen.width_m + own.width_m) / 2.0 + BESIDE_M;
            if seen.headway_m > 0.0 && seen.lateral_m.abs() < room_m {
                self.gap_m = self.gap_m.min(seen.headway_m - seen.length_m);
            }
        }
        self.braking_mps2 = self.braking_mps2.max(-command.accel_mps2);
    }
}

/// Sample of an ego's episodes, shared by all its controllers.
#[derive(Clone, Default)]
pub struct Transcripts(Arc<Mutex<TranscriptLog>>);

#[derive(Default)]
pub(super) struct TranscriptLog {
    episodes: u64,
    sample: Sample,
    /// Begin of the first episode.
    pub(super) began: Option<Instant>,
    /// Time spent on checks so far.
    pub(super) spent: Duration,
    /// True once an episode was played again with all pauses.
    pub(super) is_paced: bool,
    /// Episodes that were played again so far.
    pub(super) compared: u64,
    pub(super) found: Option<Unrepeatable>,
}

impl Transcripts {
    pub(super) fn lock(&self) -> MutexGuard<'_, TranscriptLog> {
        // Lists of finished transcripts stay usable if a thread panicked beside them.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether both are of one ego.
    pub fn is(&self, other: &Transcripts) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    fn note(&self, mut transcript: Transcript, hardness: Hardness, before: Hardness) {
        let mut log = self.lock();
        // Numbered when it ends, because only finished episodes are in the order of the
        // state.
        transcript.number = log.episodes;
        log.episodes += 1;
        log.sample.add(&Arc::new(transcript), hardness, before);
    }
}

impl fmt::Debug for Transcripts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Transcripts")
    }
}

impl TranscriptLog {
    /// Takes the sample, the most telling episodes first.
    pub(super) fn take_sample(&mut self) -> Vec<Arc<Transcript>> {
        std::mem::take(&mut self.sample).in_order()
    }

    /// Puts episodes back that were not played again.
    pub(super) fn put_back(&mut self, left: &[Arc<Transcript>]) {
        for transcript in left {
            let random = scattered(transcript.number);
            rank(&mut self.sample.scattered, random, SCATTERED, transcript);
        }
    }
}

/// Bounded sample of transcripts.
#[derive(Default)]
struct Sample {
    first: Vec<Arc<Transcript>>,
    latest: VecDeque<Arc<Transcript>>,
    scattered: Vec<(f64, Arc<Transcript>)>,
    near: Vec<(f64, Arc<Transcript>)>,
    braking: Vec<(f64, Arc<Transcript>)>,
    after_near: Vec<(f64, Arc<Transcript>)>,
}

impl Sample {
    fn add(&mut self, transcript: &Arc<Transcript>, hardness: Hardness, before: Hardness) {
        if transcript.number < FIRST as u64 {
            self.first.push(Arc::clone(transcript));
        }
        if self.latest.len() == LATEST {
            self.latest.pop_front();
        }
        self.latest.push_back(Arc::clone(transcript));
        let random = scattered(transcript.number);
        rank(&mut self.scattered, random, SCATTERED, transcript);
        rank(&mut self.near, hardness.gap_m, HARD, transcript);
        rank(&mut self.braking, -hardness.braking_mps2, HARD, transcript);
        rank(&mut self.after_near, before.gap_m, HARD, transcript);
    }

    /// Returns every episode once, the most telling first.
    fn in_order(self) -> Vec<Arc<Transcript>> {
        let ranked = |list: Vec<(f64, Arc<Transcript>)>| list.into_iter().map(|(_, it)| it);
        let mut latest = self.latest.into_iter().rev();
        // Neighbours come first, because an ego that alternates shows in one of them.
        let mut all: Vec<Arc<Transcript>> = latest.by_ref().take(2).collect();
        let mut known: BTreeSet<u64> = all.iter().map(|it| it.number).collect();
        let mut lists: [VecDeque<Arc<Transcript>>; 6] = [
            ranked(self.after_near).collect(),
            ranked(self.scattered).collect(),
            self.first.into(),
            ranked(self.near).collect(),
            ranked(self.braking).collect(),
            latest.collect(),
        ];
        while lists.iter().any(|list| !list.is_empty()) {
            for list in &mut lists {
                // In turns, so that a check that ends early has seen a part of
                // each list.
                all.extend(list.pop_front().filter(|it| known.insert(it.number)));
            }
        }
        all
    }
}

/// Keeps the episodes with the smallest scores, at most `most`, in their order.
fn rank(
    list: &mut Vec<(f64, Arc<Transcript>)>,
    score: f64,
    most: usize,
    transcript: &Arc<Transcript>,
) {
    // After equal scores, so that the earlier episode stays.
    let at = list.partition_point(|(other, _)| *other <= score);
    // Most episodes are no candidates and cost a search only.
    if at < most {
        list.insert(at, (score, Arc::clone(transcript)));
        list.truncate(most);
    }
}

/// Returns a score that is equal for equal numbers, and in no order.
fn scattered(number: u64) -> f64 {
    // Any period of the ego, such as every tenth episode, has its share of the least.
    let mut z = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
    (z ^ (z >> 32)) as f64
}

/// A foreign ego whose episodes are recorded.
pub struct Recorder {
    ego: Box<dyn Controller>,
    log: Transcripts,
    /// Maker of a new ego for each episode, if requested.
    anew: Option<Maker>,
    is_used: bool,
    briefing: Option<Briefing>,
    /// `None` between episodes, after a fault, and in a copy.
    episode: Option<Transcript>,
    /// Road users in the transcript so far, with the ego.
    seen: usize,
    hardness: Hardness,
    before: Hardness,
}

impl Recorder {
    /// Wraps an ego.
    pub fn new(ego: Box<dyn Controller>, log: &Transcripts) -> Recorder {
        Recorder {
            ego,
            log: log.clone(),
            anew: None,
            is_used: false,
            briefing: None,
            episode: None,
            seen: 0,
            hardness: Hardness::NONE,
            before: Hardness::NONE,
        }
    }

    /// Makes every episode begin with a new ego.
    pub fn anew(mut self, make: Maker) -> Recorder {
        self.anew = Some(make);
        self
    }

    fn close(&mut self) {
        if let Some(episode) = self.episode.take().filter(|it| !it.steps.is_empty()) {
            self.log.note(episode, self.hardness, self.before);
            // State that is kept shows in the episode after a hard one.
            self.before = self.hardness;
        }
    }
}

impl Controller for Recorder {
    fn brief(&mut self, briefing: &Briefing) {
        self.briefing = Some(briefing.clone());
        // Road that is laid ahead during an episode.
        if let Some(episode) = self.episode.as_mut().filter(|_| self.seen <= MOST_SEEN) {
            let at = (episode.steps.len(), briefing.clone());
            episode.briefings.push(at);
        }
        self.ego.brief(briefing);
    }

    fn reset(&mut self, seed: u64) {
        self.close();
        if let Some(make) = self.anew.as_ref().filter(|_| self.is_used) {
            self.ego = make();
            if let Some(briefing) = &self.briefing {
                self.ego.brief(briefing);
            }
        }
        self.is_used = true;
        self.log.lock().began.get_or_insert_with(Instant::now);
        (self.seen, self.hardness) = (0, Hardness::NONE);
        self.episode = Some(Transcript {
            seed,
            briefing: self.briefing.clone(),
            ..Transcript::default()
        });
        self.ego.reset(seed);
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let command = self.ego.control(percept);
        match (&command, &mut self.episode) {
            (Ok(command), Some(episode)) => {
                self.hardness.note(percept, *command);
                // Memory grows with the agents seen, and not with the steps alone.
                self.seen += 1 + percept.others.len();
                // The beginning of an episode can be compared as well.
                if self.seen <= MOST_SEEN {
                    episode.steps.push((percept.clone(), *command));
                }
            }
            // An episode with a fault counts in no rate.
            (Err(_), _) => self.episode = None,
            (Ok(_), None) => {}
        }
        command
    }

    fn finish(&mut self) {
        self.close();
        self.ego.finish();
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        let copy = self.ego.fork()?;
        Some(Box::new(Recorder {
            ego: copy,
            log: self.log.clone(),
            anew: self.anew.clone(),
            // A copy has no transcript of what it went through before.
            episode: None,
            briefing: self.briefing.clone(),
            ..*self
        }))
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.close();
    }
}
