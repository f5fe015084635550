//! The pages: who watches, and who is at the wheel.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::message::PageMessage;

/// Messages that may wait for a page. A page that is further behind is let go.
const WAITING: usize = 512;
/// Pages at a time.
const MOST_PAGES: usize = 8;

/// All pages that listen.
#[derive(Clone, Debug, Default)]
pub(super) struct Hub(Arc<Mutex<Pages>>);

#[derive(Debug, Default)]
struct Pages {
    next: u64,
    /// In the order of their coming. The first is at the wheel.
    listening: Vec<Page>,
}

#[derive(Debug)]
struct Page {
    id: u64,
    messages: SyncSender<Arc<str>>,
}

impl Hub {
    fn pages(&self) -> MutexGuard<'_, Pages> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a page. `None`: there are enough.
    pub(super) fn join(&self) -> Option<(u64, Receiver<Arc<str>>)> {
        let mut pages = self.pages();
        if pages.listening.len() >= MOST_PAGES {
            return None;
        }
        let (messages, receiver) = sync_channel(WAITING);
        // Numbers are never used again, so an old page cannot ask as a new
        // one.
        pages.next += 1;
        let id = pages.next;
        pages.listening.push(Page { id, messages });
        Some((id, receiver))
    }

    /// Removes a page. The next takes the wheel if it was at it.
    pub(super) fn leave(&self, id: u64) {
        self.pages().listening.retain(|page| page.id != id);
    }

    /// Returns the page at the wheel.
    pub(super) fn wheel(&self) -> Option<u64> {
        self.pages().listening.first().map(|page| page.id)
    }

    /// Sends a message to one page, or to all.
    pub(super) fn send(&self, to: Option<u64>, message: &PageMessage) {
        // Invariant: a message has no map with keys that are no texts.
        let Ok(text) = serde_json::to_string(message) else {
            return;
        };
        // One text for all pages, since frames are sent many times a second.
        let text: Arc<str> = text.into();
        self.pages().listening.retain(|page| {
            if to.is_some_and(|to| to != page.id) {
                return true;
            }
            // A page that does not read must not hold up the others.
            let sent = page.messages.try_send(Arc::clone(&text));
            !matches!(
                sent,
                Err(TrySendError::Disconnected(_) | TrySendError::Full(_))
            )
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_page_takes_the_wheel_and_a_deaf_one_is_let_go() {
        let hub = Hub::default();
        let (first, _deaf) = hub.join().expect("room");
        let (second, messages) = hub.join().expect("room");
        assert_eq!(hub.wheel(), Some(first));
        for _ in 0..WAITING + 1 {
            hub.send(Some(first), &PageMessage::Note("hello".to_owned()));
        }
        assert_eq!(hub.wheel(), Some(second));
        hub.send(None, &PageMessage::Note("you".to_owned()));
        assert_eq!(&*messages.recv().expect("sent"), r#"{"note":"you"}"#);
        hub.leave(second);
        assert_eq!(hub.wheel(), None);
    }

    #[test]
    fn the_number_of_pages_is_bounded() {
        let hub = Hub::default();
        let pages: Vec<_> = (0..MOST_PAGES).map(|_| hub.join().expect("room")).collect();
        assert!(hub.join().is_none());
        hub.leave(pages[0].0);
        assert!(hub.join().is_some());
    }
}
