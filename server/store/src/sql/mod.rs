//! Statements that run on SQLite and on PostgreSQL.
//!
//! The store has one text for each statement, and both databases run it. So they can differ only where this module, the
//! migrations and what opens a database differ. Texts keep to what both understand:
//!
//! - Parameters are `$1`, `$2`, …
//! - Integers are 64 bits wide; a boolean column is an integer, 0 or 1, and is compared with one.
//! - A sum is cast to `bigint`, an upsert names its conflicting columns, and an order with null says where it goes.
//! - `max(a, b)`, `instr` and `json_each` are functions of SQLite; the first migration of PostgreSQL defines them.
//!
//! # Layout
//!
//! - `connection`: connections and pools. `query`: a statement with its parameters. `row`: what it returns.
//! - `turns`: which client gets the next connection.

mod connection;
mod query;
mod row;
mod turns;

pub(super) use connection::{Connection, Pool, RawPool};
pub(super) use query::{Builder, Query, Value, query, query_as, run_all, scalar};
pub(super) use row::{ColumnId, Row, from_row};
pub(super) use turns::for_same_client;
pub use turns::{for_all_clients, for_client};
