//! The tables of a database: its migrations, and whether this program can work on them.

use super::sql::{Connection, Pool, RawPool, scalar};
use super::{Result, StoreError};
use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::{AssertSqlSafe, SqlSafeStr as _};

/// The text of a migration for each database.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) name: &'static str,
    pub(super) sqlite: &'static str,
    pub(super) postgres: &'static str,
}

macro_rules! steps {
    ($($name:literal),*) => {
        &[$(Step {
            name: $name,
            sqlite: include_str!(concat!("../../../migrations/sqlite/", $name, ".sql")),
            postgres: include_str!(concat!("../../../migrations/postgres/", $name, ".sql")),
        }),*]
    };
}

/// Migrations in order, one file each for each database. The first [`STEPS_OF_0_1_0`] make a database of version 0.1.0,
/// each for one subject. Changes of later versions are in files of their own. A released migration never changes. One that
/// programs of the version before can live with says so in `older_programs`, so that they need not stop.
pub(super) const MIGRATIONS: &[Step] = steps!(
    "0001_displays",
    "0002_artifacts",
    "0003_datasets",
    "0004_kernels",
    "0005_jobs",
    "0006_tokens",
    "0007_signing",
    "0008_devices",
    "0009_webhooks"
);

/// Number of migrations of the oldest version whose databases can be migrated.
#[cfg(test)]
pub(super) const STEPS_OF_0_1_0: usize = 9;

/// Applies the migrations that are new to the database. One that a newer program has migrated stays as it is, if this
/// program can work on it.
pub(super) async fn bring_up_to_date(writers: &Pool) -> Result<()> {
    require_suitable(&mut writers.acquire().await?).await?;
    let migrator = |text| {
        let mut migrator = migrator(MIGRATIONS.len(), text);
        migrator.set_ignore_missing(true);
        migrator
    };
    // In PostgreSQL the migrator takes an advisory lock of its own.
    let done = match writers.raw() {
        RawPool::Sqlite(writers) => migrator(|step| step.sqlite).run(writers).await,
        RawPool::Postgres(writers) => migrator(|step| step.postgres).run(writers).await,
    };
    done.map_err(migration_error)
}

/// Refuses a database that a newer program has migrated so that this one cannot work on it.
pub(super) async fn require_suitable(connection: &mut Connection) -> Result<()> {
    // The first migration makes this table.
    if !has_table(connection, "older_programs").await? {
        return Ok(());
    }
    let sql = "select min(version) from _sqlx_migrations where version > $1 and not exists \
               (select 1 from older_programs where migration = version and known_min <= $1)";
    let known = i64::try_from(MIGRATIONS.len()).unwrap_or(i64::MAX);
    let unsuitable: Option<i64> = scalar(sql).bind(known).fetch_one(connection).await?;
    unsuitable.map_or(Ok(()), |step| Err(StoreError::NewerDatabase { step }))
}

/// Whether the database has this table.
pub(super) async fn has_table(connection: &mut Connection, name: &str) -> Result<bool> {
    let sql = match connection.is_postgres() {
        true => "select to_regclass($1) is not null",
        false => "select exists (select 1 from sqlite_master where type = 'table' and name = $1)",
    };
    Ok(scalar(sql).bind(name).fetch_one(connection).await?)
}

/// Refuses the target of an unfinished transfer.
pub(super) async fn require_finished(connection: &mut Connection) -> Result<()> {
    marked_source(connection).await?.map_or(Ok(()), |_| Err(StoreError::Unfinished))
}

/// The source of an unfinished transfer into this database; `None`: there is none.
pub(super) async fn marked_source(connection: &mut Connection) -> Result<Option<String>> {
    if !has_table(connection, "unfinished_transfer").await? {
        return Ok(None);
    }
    Ok(Some(scalar("select source from unfinished_transfer").fetch_one(connection).await?))
}

pub(super) fn migration_error(error: MigrateError) -> StoreError {
    match error {
        MigrateError::VersionMissing(step) => StoreError::NewerDatabase { step },
        other => StoreError::Migration(other),
    }
}

/// Returns the first `steps` migrations, with their text for one database.
pub(super) fn migrator(steps: usize, text: fn(&Step) -> &'static str) -> Migrator {
    let migrations = MIGRATIONS.iter().take(steps).zip(1..).map(|(step, version)| {
        // The text is compiled into the program and contains no outside input.
        let sql = AssertSqlSafe(text(step)).into_sql_str();
        Migration::new(version, step.name.into(), MigrationType::Simple, sql, false)
    });
    Migrator::with_migrations(migrations.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn every_migration_is_listed_in_order() {
        for database in ["sqlite", "postgres"] {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../migrations").join(database);
            let mut files: Vec<String> =
                std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
            files.sort();
            let listed: Vec<String> = MIGRATIONS.iter().map(|step| format!("{}.sql", step.name)).collect();
            assert_eq!(files, listed, "{database}");
        }
    }
}
