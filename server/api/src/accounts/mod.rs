//! What each client uses: calls, memory and streams, each with a limit for one client and one for all.
//!
//! A [`Client`] is the holder of a token, or a machine without one. No client can use up what others need:
//!
//! | what | limit for all | limit for one client |
//! |---|---|---|
//! | calls (`rate`) | none | `calls_per_s_max` of the settings, divided by the number of living servers |
//! | memory for messages (`memory_budget`) | `under_way_mib_max` | three quarters of it, by address |
//! | memory for computations ([`Computing`]) | `computing_mib_max` | half of it; a quarter is kept for small ones of clients that spent little |
//! | computations at once ([`Computing`]) | six, each on threads of its own | all but two, which are kept for the same; the client that spent least is next |
//! | connections to the database ([`for_client`]) | four to SQLite, eight to PostgreSQL | all but one; the client that held them least is next |
//! | streams (`streams`) | a number for each kind | half or a quarter of it |
//! | connections (`streams`) | 800, 400 from one address | 100 for a token |
//!
//! [`for_client`]: lightpath_store::for_client
//! [`Client`]: lightpath_service::Client
//! [`Computing`]: lightpath_service::Computing

mod memory_budget;
mod rate;
mod streams;

pub use memory_budget::MemoryBudget;
pub(crate) use memory_budget::Share;
pub use rate::Rate;
pub(crate) use streams::{CONNECTIONS_MAX, OpenStream, StreamKind, Streams};
