//! A statement with its parameters.

use super::connection::{Connection, Raw, Target};
use super::row::{Column, Columns, Row};
use sqlx::query::Query as SqlxQuery;
use sqlx::{AssertSqlSafe, Database, Encode, Executor as _, Type};
use std::fmt::Write as _;
use std::mem::take;

/// A parameter. Its type is known even where it is null, because PostgreSQL needs it.
#[derive(Clone, Debug)]
pub(crate) enum Value {
    Integer(Option<i64>),
    Real(Option<f64>),
    Text(Option<String>),
}

macro_rules! values {
    ($($kind:ty => $variant:ident($convert:expr);)*) => {$(
        impl From<$kind> for Value {
            fn from(value: $kind) -> Self {
                Self::$variant(Some($convert(value)))
            }
        }

        impl From<Option<$kind>> for Value {
            fn from(value: Option<$kind>) -> Self {
                Self::$variant(value.map($convert))
            }
        }
    )*};
}

values! {
    i64 => Integer(i64::from);
    i32 => Integer(i64::from);
    u32 => Integer(i64::from);
    u8 => Integer(i64::from);
    bool => Integer(i64::from);
    f64 => Real(f64::from);
    String => Text(String::from);
    &String => Text(String::clone);
    &str => Text(str::to_owned);
}

impl<T: Clone> From<&Option<T>> for Value
where
    Option<T>: Into<Self>,
{
    fn from(value: &Option<T>) -> Self {
        value.clone().into()
    }
}

/// A parameter, or a tuple of parameters in their order.
pub(crate) trait Values {
    fn append_to(self, values: &mut Vec<Value>);
}

impl<T: Into<Value>> Values for T {
    fn append_to(self, values: &mut Vec<Value>) {
        values.push(self.into());
    }
}

/// Tuples of parameters.
macro_rules! tuples {
    ($($name:ident $number:tt),*) => {
        impl<$($name: Into<Value>),*> Values for ($($name,)*) {
            fn append_to(self, values: &mut Vec<Value>) {
                values.extend([$(self.$number.into()),*]);
            }
        }
    };
}

tuples!(A 0, B 1);
tuples!(A 0, B 1, C 2);
tuples!(A 0, B 1, C 2, D 3);
tuples!(A 0, B 1, C 2, D 3, E 4);
tuples!(A 0, B 1, C 2, D 3, E 4, F 5);
tuples!(A 0, B 1, C 2, D 3, E 4, F 5, G 6);
tuples!(A 0, B 1, C 2, D 3, E 4, F 5, G 6, H 7);

/// The text of a statement: fixed, or put together by [`Builder`].
#[derive(Clone, Debug)]
enum Text {
    Fixed(&'static str),
    Built(String),
}

/// A statement with its parameters.
#[derive(Clone, Debug)]
pub(crate) struct Query {
    text: Text,
    values: Vec<Value>,
}

/// A statement with parameters `$1`, `$2`, … to bind in this order.
pub(crate) fn query(text: &'static str) -> Query {
    Query { text: Text::Fixed(text), values: Vec::new() }
}

/// A statement whose rows have one column.
pub(crate) fn scalar<T: Column>(text: &'static str) -> Typed<T> {
    Typed { query: query(text), read: |row| row.try_get(0) }
}

/// A statement whose rows are read as tuples.
pub(crate) fn query_as<T: Columns>(text: &'static str) -> Typed<T> {
    Typed { query: query(text), read: T::of }
}

impl Query {
    /// Binds the next parameter, or the next ones as a tuple.
    pub(crate) fn bind(mut self, values: impl Values) -> Self {
        values.append_to(&mut self.values);
        self
    }

    /// Runs the statement and returns the number of changed rows.
    pub(crate) async fn execute(self, mut target: impl Target) -> Result<u64, sqlx::Error> {
        let mut lent = target.connect().await?;
        match lent.raw() {
            Raw::Sqlite(connection) => Ok(self.of().execute(connection).await?.rows_affected()),
            Raw::Postgres(connection) => Ok(self.of().execute(connection).await?.rows_affected()),
        }
    }

    pub(crate) async fn fetch_optional(self, mut target: impl Target) -> Result<Option<Row>, sqlx::Error> {
        let mut lent = target.connect().await?;
        match lent.raw() {
            Raw::Sqlite(connection) => Ok(self.of().fetch_optional(connection).await?.map(Row::Sqlite)),
            Raw::Postgres(connection) => Ok(self.of().fetch_optional(connection).await?.map(Row::Postgres)),
        }
    }

    /// The only row.
    ///
    /// # Errors
    ///
    /// [`sqlx::Error::RowNotFound`] if there is none.
    pub(crate) async fn fetch_one(self, target: impl Target) -> Result<Row, sqlx::Error> {
        self.fetch_optional(target).await?.ok_or(sqlx::Error::RowNotFound)
    }

    pub(crate) async fn fetch_all(self, mut target: impl Target) -> Result<Vec<Row>, sqlx::Error> {
        let mut lent = target.connect().await?;
        match lent.raw() {
            Raw::Sqlite(connection) => {
                Ok(self.of().fetch_all(connection).await?.into_iter().map(Row::Sqlite).collect())
            }
            Raw::Postgres(connection) => {
                Ok(self.of().fetch_all(connection).await?.into_iter().map(Row::Postgres).collect())
            }
        }
    }

    /// The statement as sqlx knows it.
    fn of<D: Database>(self) -> SqlxQuery<'static, D, D::Arguments>
    where
        Option<i64>: Encode<'static, D> + Type<D>,
        Option<f64>: Encode<'static, D> + Type<D>,
        Option<String>: Encode<'static, D> + Type<D>,
    {
        let query = match self.text {
            Text::Fixed(text) => sqlx::query(text),
            // `Builder` binds every value that comes from outside.
            Text::Built(text) => sqlx::query(AssertSqlSafe(text)),
        };
        self.values.into_iter().fold(query, |query, value| match value {
            Value::Integer(value) => query.bind(value),
            Value::Real(value) => query.bind(value),
            Value::Text(value) => query.bind(value),
        })
    }
}

/// A statement whose rows are read as `T`.
pub(crate) struct Typed<T> {
    query: Query,
    read: fn(&Row) -> Result<T, sqlx::Error>,
}

impl<T> Typed<T> {
    pub(crate) fn bind(mut self, values: impl Values) -> Self {
        self.query = self.query.bind(values);
        self
    }

    pub(crate) async fn fetch_optional(self, target: impl Target) -> Result<Option<T>, sqlx::Error> {
        self.query.fetch_optional(target).await?.as_ref().map(self.read).transpose()
    }

    pub(crate) async fn fetch_one(self, target: impl Target) -> Result<T, sqlx::Error> {
        (self.read)(&self.query.fetch_one(target).await?)
    }

    pub(crate) async fn fetch_all(self, target: impl Target) -> Result<Vec<T>, sqlx::Error> {
        self.query.fetch_all(target).await?.iter().map(self.read).collect()
    }
}

/// Runs several statements without parameters, which go to PostgreSQL in one message.
pub(crate) async fn run_all(text: &'static str, connection: &mut Connection) -> Result<(), sqlx::Error> {
    match connection.raw() {
        Raw::Sqlite(connection) => connection.execute(sqlx::raw_sql(text)).await.map(drop),
        Raw::Postgres(connection) => connection.execute(sqlx::raw_sql(text)).await.map(drop),
    }
}

/// A statement that is put together from parts.
#[derive(Clone, Debug)]
pub(crate) struct Builder {
    text: String,
    values: Vec<Value>,
}

impl Builder {
    pub(crate) fn new(text: impl Into<String>) -> Self {
        Self { text: text.into(), values: Vec::new() }
    }

    /// Appends text of the program, never text from outside.
    pub(crate) fn push(&mut self, text: impl AsRef<str>) -> &mut Self {
        self.text.push_str(text.as_ref());
        self
    }

    /// Appends a parameter.
    pub(crate) fn push_bind(&mut self, value: impl Into<Value>) -> &mut Self {
        self.values.push(value.into());
        // Writing into a text cannot fail.
        let _ = write!(self.text, "${}", self.values.len());
        self
    }

    /// The text so far.
    #[cfg(test)]
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// The statement; the builder is empty afterwards.
    pub(crate) fn build(&mut self) -> Query {
        Query { text: Text::Built(take(&mut self.text)), values: take(&mut self.values) }
    }
}
