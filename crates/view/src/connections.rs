//! A bounded number of open connections: connections without the token are closed for new ones, the oldest first.

use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Maximum number of open connections.
const MAX_CONNECTIONS: usize = 48;

/// Open connections, the oldest first.
#[derive(Default)]
pub(super) struct Connections(Mutex<Slots>);

#[derive(Default)]
struct Slots {
    /// Number of the next connection.
    next: u64,
    open: Vec<Connection>,
}

struct Connection {
    number: u64,
    /// Handle that closes the connection when its place is needed.
    stream: TcpStream,
    /// True once a request had the token.
    known: bool,
}

/// Place of a connection, which is free again when this is dropped.
pub(super) struct Place {
    connections: Arc<Connections>,
    number: u64,
}

impl Connections {
    /// A place for a connection. If all are taken, the oldest one without the token is closed; `None` if all have it.
    pub(super) fn admit(connections: &Arc<Self>, stream: &TcpStream) -> Option<Place> {
        let held = stream.try_clone().ok()?;
        let mut slots = connections.lock();
        if slots.open.len() >= MAX_CONNECTIONS {
            let oldest = slots.open.iter().position(|connection| !connection.known)?;
            let left = slots.open.remove(oldest);
            let _ = left.stream.shutdown(Shutdown::Both);
        }
        let number = slots.next;
        slots.next += 1;
        slots.open.push(Connection {
            number,
            stream: held,
            known: false,
        });
        drop(slots);
        Some(Place {
            connections: connections.clone(),
            number,
        })
    }

    fn lock(&self) -> MutexGuard<'_, Slots> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    /// Keeps the place, since a request of the client had the token.
    pub(super) fn keep(&self) {
        let mut slots = self.connections.lock();
        let mine = slots
            .open
            .iter_mut()
            .find(|connection| connection.number == self.number);
        if let Some(connection) = mine {
            connection.known = true;
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.connections
            .lock()
            .open
            .retain(|connection| connection.number != self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;
    use std::net::TcpListener;

    /// Unauthenticated connections are evicted, oldest first; authenticated ones stay; a dropped place is free.
    #[test]
    fn connections_without_the_token_are_closed_and_places_come_back() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        let connections = Arc::new(Connections::default());
        let connect = || {
            let client = TcpStream::connect(address).expect("a connection");
            let (server, _) = listener.accept().expect("a connection");
            (client, Connections::admit(&connections, &server))
        };
        let mut all: Vec<_> = (0..MAX_CONNECTIONS).map(|_| connect()).collect();
        all[0].1.as_ref().expect("a place").keep();
        let (_, place) = connect();
        assert!(place.is_some(), "the oldest is closed");
        assert_eq!(connections.lock().open.len(), MAX_CONNECTIONS);
        // The second was the oldest without the token: its client reads the end.
        assert_eq!(all[1].0.read(&mut [0]).expect("an end"), 0);
        drop(place);
        assert_eq!(connections.lock().open.len(), MAX_CONNECTIONS - 1);
        let (_, last) = connect();
        let last = last.expect("a place");
        last.keep();
        for (_, place) in &all {
            place.as_ref().expect("a place").keep();
        }
        assert!(connect().1.is_none(), "all have the token");
        drop((all, last));
        assert!(connections.lock().open.is_empty());
    }
}
