//! Connection to a viewer that runs already.

use std::time::{Duration, Instant};

use re_grpc_client::write::{Client, ClientConnectionState, GrpcFlushError, Options};
use re_log_types::LogMsg;

use super::error::ViewError;

/// Address at which a viewer on this machine listens.
const ADDRESS: &str = "rerun+http://127.0.0.1:9876/proxy";
/// Time for the viewer to answer.
const ANSWER: Duration = Duration::from_secs(5);
/// Time to deliver what is on its way when a command ends.
const DELIVERY: Duration = Duration::from_secs(8);

/// Connection to a viewer.
pub(super) struct Connection(Client);

impl Connection {
    /// Connects to the viewer at the SDK's usual address.
    pub(super) fn open() -> Result<Connection, ViewError> {
        let none = || ViewError::NoViewer {
            address: ADDRESS.to_owned(),
        };
        let uri = ADDRESS.parse().map_err(|_| none())?;
        let client = Client::new(uri, Options::default());
        let began = Instant::now();
        while began.elapsed() < ANSWER {
            match client.status() {
                ClientConnectionState::Connected => return Ok(Connection(client)),
                ClientConnectionState::Disconnected(_) => break,
                ClientConnectionState::Connecting { .. } => {
                    std::thread::sleep(Duration::from_millis(20));
                }
            }
        }
        Err(none())
    }

    pub(super) fn send(&self, messages: Vec<LogMsg>) -> Result<(), ViewError> {
        for message in messages {
            self.0.send_blocking(message);
        }
        self.check()
    }

    /// Returns an error if the viewer was closed.
    pub(super) fn check(&self) -> Result<(), ViewError> {
        match self.0.status() {
            ClientConnectionState::Disconnected(_) => Err(ViewError::Closed),
            _ => Ok(()),
        }
    }

    /// Waits until all messages are delivered.
    pub(super) fn finish(&self) -> Result<(), ViewError> {
        let delivered = self.0.flush_blocking(DELIVERY);
        delivered.map_err(|error| match error {
            GrpcFlushError::Timeout { .. } => ViewError::Stuck,
            _ => ViewError::Closed,
        })
    }
}
