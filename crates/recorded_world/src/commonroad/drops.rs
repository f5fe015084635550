//! Content of a scenario without an effect on its world, so that nothing is dropped silently.

/// Content of one kind that has no effect on the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DroppedContent {
    /// Kind, such as `intersections`.
    pub kind: &'static str,
    /// Line of the first of them.
    pub line: usize,
    /// Their number.
    pub count: usize,
}

/// Collector of content without an effect.
#[derive(Debug, Default)]
pub(super) struct Drops(Vec<DroppedContent>);

impl Drops {
    /// Counts an element of a kind by its line.
    pub(super) fn add(&mut self, kind: &'static str, line: usize) {
        self.add_many(kind, line, 1);
    }

    /// Counts several elements, the first of them at a line.
    pub(super) fn add_many(&mut self, kind: &'static str, line: usize, count: usize) {
        // Nothing of a kind would otherwise be listed with a count of 0.
        if count == 0 {
            return;
        }
        match self.0.iter_mut().find(|it| it.kind == kind) {
            Some(known) => {
                known.line = known.line.min(line);
                known.count += count;
            }
            None => self.0.push(DroppedContent { kind, line, count }),
        }
    }

    /// Returns the content by kind.
    pub(super) fn list(self) -> Vec<DroppedContent> {
        self.0
    }
}
