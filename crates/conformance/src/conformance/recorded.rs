//! The common examination: a recordable subject is played in every order.

use std::thread;

use super::{Nonconformities, Nonconformity, Place, Promise};

/// Number of episodes of each run.
const EPISODES: u64 = 2;
/// Steps after which a copy is taken.
const FORKS_AT: [usize; 2] = [0, 7];

/// Numbers of a step: of the reset or of an action.
pub(super) type StepNumbers = Vec<f64>;

/// A subject whose episodes can be recorded.
pub(super) trait Subject: Sized {
    /// Returns the names of the numbers in a row.
    fn names(&self) -> Vec<String>;

    /// Returns a problem that is known before any episode.
    fn shapes(&self) -> Option<String> {
        None
    }

    /// Begins an episode.
    fn begin(&mut self, episode: u64) -> StepNumbers;

    /// Takes step number `step`, from 1 on, or returns `None` after the end.
    fn step(&mut self, episode: u64, step: usize) -> Option<StepNumbers>;

    /// Returns a problem with a number, by its position in the row.
    fn flaw(&self, _at: usize, _value: f64) -> Option<String> {
        None
    }

    /// Returns a problem of the last step that its numbers do not show.
    fn fault(&self) -> Option<(Promise, String)> {
        None
    }

    /// Returns a copy, if possible.
    fn fork(&self) -> Option<Self> {
        None
    }
}

/// Returns a deterministic action. All actions occur, in no simple order.
pub(super) fn action(episode: u64, step: usize, actions: usize) -> usize {
    // The guard avoids a division by zero for a subject without actions.
    (step * 7 + step / 3 + episode as usize) % actions.max(1)
}

/// Plays the rest of an episode from `step` on.
fn rest<S: Subject>(subject: &mut S, episode: u64, step: usize) -> Vec<StepNumbers> {
    (step + 1..)
        .map_while(|step| subject.step(episode, step))
        .collect()
}

fn whole<S: Subject>(subject: &mut S, episode: u64) -> Vec<StepNumbers> {
    let mut rows = vec![subject.begin(episode)];
    rows.extend(rest(subject, episode, 0));
    rows
}

/// Finds the first broken promise of each kind.
///
/// `make` must return unused subjects that are equal in every respect.
pub(super) fn examine<S: Subject>(make: impl Fn() -> S + Sync) -> Result<(), Nonconformities> {
    let mut found = Findings {
        // A subject of its own, so that those that are played stay unused.
        names: make().names(),
        list: Vec::new(),
    };
    if let Some(what) = make().shapes() {
        found.add(Promise::Spaces, None, None, what);
        // Without valid shapes no episode can be played.
        return Err(Nonconformities(found.list));
    }
    let reference: Vec<Vec<StepNumbers>> = (0..EPISODES)
        .map(|episode| found.sound(&mut make(), episode))
        .collect();
    let episodes = || (0..EPISODES).zip(&reference);

    for (episode, expected) in episodes() {
        let again = whole(&mut make(), episode);
        found.same(Promise::Deterministic, (episode, 0), &again, expected);
    }
    // A subject that is not deterministic breaks every further promise as well.
    if found.has(Promise::Deterministic) {
        return Err(Nonconformities(found.list));
    }

    let mut veteran = make();
    // The first run of episode 0 is on an unused subject, which tests no reset. Both
    // episodes are therefore played twice.
    for (episode, expected) in episodes().chain(episodes()) {
        let again = whole(&mut veteran, episode);
        found.same(Promise::PureReset, (episode, 0), &again, expected);
        // The next reset interrupts an episode.
        veteran.begin(episode);
        veteran.step(episode, 1);
    }

    for (episode, expected) in episodes() {
        // Step 0 tests a copy right after a reset, and step 7 a copy with
        // history.
        // At least one step must be left, or there would be nothing to compare.
        for at in FORKS_AT.into_iter().filter(|at| at + 1 < expected.len()) {
            let mut original = make();
            original.begin(episode);
            (1..=at).for_each(|step| drop(original.step(episode, step)));
            let (Some(mut copy), Some(mut other)) = (original.fork(), original.fork()) else {
                // Copies are optional, so a subject without them breaks no promise.
                continue;
            };
            // Copies are played first, so that shared state would change the original.
            let copied = rest(&mut copy, episode, at);
            whole(&mut other, (episode + 1) % EPISODES);
            let went_on = rest(&mut original, episode, at);
            for rows in [copied, went_on] {
                found.same(Promise::Fork, (episode, at + 1), &rows, &expected[at + 1..]);
            }
        }
    }

    let play = &|episode| whole(&mut make(), episode);
    let together: Vec<Vec<StepNumbers>> = thread::scope(|scope| {
        let threads: Vec<_> = (0..EPISODES)
            // Every episode runs twice at once, so equal seeds run side by side.
            .chain(0..EPISODES)
            .map(|episode| scope.spawn(move || play(episode)))
            .collect();
        // A thread that panics gives no row, which then differs from the reference.
        let rows = threads
            .into_iter()
            .map(|one| one.join().unwrap_or_default());
        rows.collect()
    });
    for ((episode, expected), rows) in episodes().chain(episodes()).zip(&together) {
        found.same(Promise::Parallel, (episode, 0), rows, expected);
    }
    if found.list.is_empty() {
        Ok(())
    } else {
        Err(Nonconformities(found.list))
    }
}

struct Findings {
    names: Vec<String>,
    list: Vec<Nonconformity>,
}

impl Findings {
    fn has(&self, promise: Promise) -> bool {
        self.list.iter().any(|one| one.promise == promise)
    }

    /// Records the first finding of a kind, because later ones often follow from it.
    fn add(
        &mut self,
        promise: Promise,
        step: Option<(u64, usize)>,
        signal: Option<usize>,
        what: String,
    ) {
        if !self.has(promise) {
            let signal = signal.and_then(|at| self.names.get(at).cloned());
            self.list.push(Nonconformity {
                promise,
                place: Place { step, signal },
                what,
            });
        }
    }

    /// Plays an episode and checks every number.
    fn sound<S: Subject>(&mut self, subject: &mut S, episode: u64) -> Vec<StepNumbers> {
        let mut rows = Vec::new();
        let mut next = Some(subject.begin(episode));
        while let Some(row) = next {
            let step = Some((episode, rows.len()));
            for (at, &value) in row.iter().enumerate() {
                if !value.is_finite() {
                    let what = format!("is {value}, or was not written");
                    self.add(Promise::Finite, step, Some(at), what);
                } else if let Some(what) = subject.flaw(at, value) {
                    self.add(Promise::Spaces, step, Some(at), what);
                }
            }
            if let Some((promise, what)) = subject.fault() {
                self.add(promise, step, None, what);
            }
            rows.push(row);
            next = subject.step(episode, rows.len());
        }
        rows
    }

    /// Compares bit for bit. The first row is that of step `from.1`.
    fn same(
        &mut self,
        promise: Promise,
        from: (u64, usize),
        found: &[StepNumbers],
        expected: &[StepNumbers],
    ) {
        let (episode, first) = from;
        // Lengths come last, because a number that differs names its signal.
        for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
            let pairs = found.iter().zip(expected);
            // Bits and not values: NaN equals itself, and 0 differs from −0.
            let mut bits = pairs.map(|(a, b)| [a.to_bits(), b.to_bits()]);
            if let Some(at) = bits.position(|[a, b]| a != b) {
                let what = format!("is {:?}, and was {:?} before", found[at], expected[at]);
                return self.add(promise, Some((episode, first + i)), Some(at), what);
            }
        }
        if found.len() != expected.len() {
            let what = format!("{} steps, and {} before", found.len(), expected.len());
            self.add(promise, Some((episode, first)), None, what);
        }
    }
}
