//! Staged rollouts.

use super::changes::Changed;
use super::kernels::find;
use super::made::{RequestMark, made_by, note_made};
use super::moves::{Promotion, promote, raise_generation, require_active, require_no_rollout, require_version};
use super::rows::{cause_of, json, key_of, to_json, to_word, word};
use super::sql::{Builder, Connection, Row, from_row, query, query_as, scalar};
use super::write::Write;
use super::{AbortReason, Result, Store, StoreError, page};
use lightpath_domain::device::Report;
use lightpath_domain::kernel::{Cause, Kernel, KernelKey};
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::rollout::{Rollout, RolloutEvent, RolloutPlan, RolloutState};
use lightpath_units::show_percent;

/// Selects rollouts with the numbers of their reports.
const ROLLOUTS: &str = "select r.*, k.display, k.wavelength_pm, k.distance_nm, \
                        (select count(*) from rollout_report p where p.kernel = r.kernel and p.number = r.number \
                        and p.passed = 1) as devices_passed, \
                        (select count(*) from rollout_report p where p.kernel = r.kernel and p.number = r.number \
                        and p.passed = 0) as devices_failed \
                        from rollout r join kernel k on k.id = r.kernel";

/// Limit on the events of a rollout that tell why devices failed: more than a person reads.
const EVENTS_MAX: u32 = 900;

/// A larger share for a rollout, for [`Store::widen_rollout`].
#[derive(Clone, Debug)]
pub struct Widening {
    /// The new share of the devices, 0 to 1.
    pub share: f64,
    /// Revision that the rollout must have; `None`: whichever it has.
    pub expected_revision: Option<u32>,
    /// Name of the caller's token; empty: no token was required.
    pub caller: String,
}

impl Store {
    /// Starts a rollout. If a request with this mark has started one already, returns that rollout instead.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::start_rollout`]; [`StoreError::AlreadyExists`] if the caller used the id of the request for
    /// another one.
    pub async fn start_rollout_once(
        &self,
        key: &KernelKey,
        plan: RolloutPlan,
        expected_active: Option<u32>,
        mark: &RequestMark,
        now_ms: i64,
    ) -> Result<Rollout> {
        let (key, mark) = (key.clone(), mark.clone());
        self.write(async move |write| {
            if let Some(number) = made_by(write.sql(), &mark).await? {
                return find_rollout(write.sql(), &key, number).await;
            }
            let started = start(write, &key, plan, expected_active, now_ms).await?;
            note_made(write, &mark, started.number, now_ms).await?;
            Ok(started)
        })
        .await
    }

    /// Starts a rollout.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the version does not exist; [`StoreError::Aborted`] if a version other than
    /// `expected_active` (`None`: no version) is active; [`StoreError::Precondition`] if a rollout is running or the
    /// version is active.
    pub async fn start_rollout(
        &self,
        key: &KernelKey,
        plan: RolloutPlan,
        expected_active: Option<u32>,
        now_ms: i64,
    ) -> Result<Rollout> {
        let key = key.clone();
        self.write(async move |write| start(write, &key, plan, expected_active, now_ms).await).await
    }

    /// Gives the version of a rollout to a larger share of the devices.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::halt_rollout`]; [`StoreError::Aborted`] if the revision is not the expected one, or the
    /// share is not larger.
    pub async fn widen_rollout(
        &self,
        key: &KernelKey,
        number: u32,
        Widening { share, expected_revision, caller }: Widening,
        now_ms: i64,
    ) -> Result<Rollout> {
        let key = key.clone();
        self.write(async move |write| {
            let rollout = running(write.sql(), &key, number, expected_revision).await?;
            let present = rollout.plan.share;
            if share <= present {
                let present = show_percent(present);
                let message = format!("{} has {present} already; halt it to go back", name(&key, number));
                return Err(StoreError::Aborted { reason: AbortReason::RolloutChanged, message });
            }
            let set = "update rollout set share = $3, revision = revision + 1 where number = $2 \
                       and kernel = (select id from kernel where name = $1)";
            query(set).bind((key.to_string(), number, share)).execute(write.sql()).await?;
            let generation = raise_generation(write, &key, now_ms).await?;
            let event = RolloutEvent {
                time_ms: now_ms,
                caller,
                message: format!(
                    "{} of the devices get the version, instead of {}",
                    show_percent(share),
                    show_percent(present)
                ),
                generation: generation.unsigned_abs(),
            };
            append_event(write, &key, number, event).await?;
            find_rollout(write.sql(), &key, number).await
        })
        .await
    }

    /// Ends a rollout by making its version active.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::halt_rollout`]; [`StoreError::Aborted`] if the revision is not the expected one.
    pub async fn complete_rollout(
        &self,
        key: &KernelKey,
        number: u32,
        expected_revision: Option<u32>,
        caller: &str,
        now_ms: i64,
    ) -> Result<Rollout> {
        let (key, caller) = (key.clone(), caller.to_owned());
        self.write(async move |write| {
            let Rollout { plan, from_version, .. } = running(write.sql(), &key, number, expected_revision).await?;
            let ending = Ending { state: RolloutState::Completed, caller, message: "the version is active".into() };
            end(write, &key, number, ending, now_ms).await?;
            let promotion = Promotion {
                version: plan.version,
                expected_active: from_version,
                cause: plan.cause,
                overridden: plan.overridden,
            };
            promote(write, &key, promotion, now_ms).await?;
            find_rollout(write.sql(), &key, number).await
        })
        .await
    }

    /// Ends a rollout: all devices go back to the active version.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Precondition`] if the rollout has ended.
    pub async fn halt_rollout(&self, key: &KernelKey, number: u32, cause: &Cause, now_ms: i64) -> Result<Rollout> {
        let (key, cause) = (key.clone(), cause.clone());
        self.write(async move |write| {
            running(write.sql(), &key, number, None).await?;
            let why = if cause.reason.is_empty() { String::new() } else { format!(": {}", cause.reason) };
            let message = format!("halted{why}");
            let ending = Ending { state: RolloutState::Halted, caller: cause.caller, message };
            end(write, &key, number, ending, now_ms).await?;
            raise_generation(write, &key, now_ms).await?;
            find_rollout(write.sql(), &key, number).await
        })
        .await
    }

    /// Halts all rollouts that are running, with this message. They may have been halted after the backup from which
    /// the database was restored.
    pub async fn halt_all_rollouts(&self, message: &str, now_ms: i64) -> Result<()> {
        let message = message.to_owned();
        self.write(async move |write| {
            let mut query = Builder::new(ROLLOUTS);
            query.push(" where r.state = 'running'");
            for row in query.build().fetch_all(write.sql()).await? {
                let Rollout { key, number, .. } = rollout_of(&row)?;
                let (state, message) = (RolloutState::Halted, message.clone());
                let ending = Ending { state, caller: String::new(), message };
                end(write, &key, number, ending, now_ms).await?;
                raise_generation(write, &key, now_ms).await?;
            }
            Ok(())
        })
        .await
    }

    /// A rollout with its events, the oldest first.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn rollout(&self, key: &KernelKey, number: u32) -> Result<(Rollout, Vec<RolloutEvent>)> {
        let mut read = self.readers().begin().await?;
        let rollout = find_rollout(&mut read, key, number).await?;
        let rows = query(
            "select e.* from rollout_event e join kernel k on k.id = e.kernel where k.name = $1 and e.number = $2 \
             order by sequence limit $3",
        )
        .bind((key.to_string(), number, page(u32::MAX)))
        .fetch_all(&mut read)
        .await?;
        let events = rows.iter().map(|row| Ok(from_row!(row, RolloutEvent { time_ms, caller, message, generation })));
        Ok((rollout, events.collect::<Result<_>>()?))
    }

    /// Number of devices that have reported about the kernel of a rollout and get its version.
    pub async fn rollout_devices(&self, rollout: &Rollout) -> Result<u32> {
        let mut read = self.readers().begin().await?;
        members(&mut read, rollout).await
    }

    /// At most `limit` rollouts of a kernel, newest first and older than the rollout `before`.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the kernel does not exist.
    pub async fn rollouts(&self, key: &KernelKey, before: Option<u32>, limit: u32) -> Result<Vec<Rollout>> {
        let mut read = self.readers().begin().await?;
        let (id, _) = find(&mut read, key).await?;
        let mut query = Builder::new(ROLLOUTS);
        query.push(" where r.kernel = ").push_bind(id);
        query.push(" and r.number < ").push_bind(before.map_or(i64::MAX, i64::from));
        query.push(" order by r.number desc limit ").push_bind(page(limit));
        query.build().fetch_all(&mut read).await?.iter().map(rollout_of).collect()
    }
}

/// How a rollout ends.
struct Ending {
    state: RolloutState,
    caller: String,
    message: String,
}

async fn start(
    write: &mut Write,
    key: &KernelKey,
    plan: RolloutPlan,
    expected_active: Option<u32>,
    now_ms: i64,
) -> Result<Rollout> {
    let (id, kernel) = find(write.sql(), key).await?;
    require_version(&kernel, plan.version)?;
    require_active(&kernel, expected_active)?;
    require_no_rollout(&kernel)?;
    if kernel.active_version == Some(plan.version) {
        let message = format!("version {} of {key} is active already", plan.version);
        return Err(StoreError::precondition(PreconditionReason::AlreadyActive, message));
    }
    let number: u32 = scalar(
        "insert into rollout (kernel, number, version, from_version, state, share, group_name, \
         failed_share_max, devices_min, self_test_loss_max, caller, reason, overridden, start_time_ms) \
         select $1, 1 + coalesce((select max(number) from rollout where kernel = $1), 0), $2, $3, 'running', \
         $4, $5, $6, $7, $8, $9, $10, $11, $12 returning number",
    )
    .bind((id, plan.version, kernel.active_version, plan.share, &plan.group, plan.failed_share_max))
    .bind((plan.devices_min, plan.self_test_loss_max, &plan.cause.caller, &plan.cause.reason))
    .bind((to_json("rollout.overridden", &plan.overridden)?, now_ms))
    .fetch_one(write.sql())
    .await?;
    let generation = raise_generation(write, key, now_ms).await?.unsigned_abs();
    let RolloutPlan { version, share, group, cause, .. } = plan;
    let group = if group.is_empty() { String::new() } else { format!(" and the group {group}") };
    let why = if cause.reason.is_empty() { String::new() } else { format!(": {}", cause.reason) };
    let share = show_percent(share);
    let message = format!("{share} of the devices{group} get version {version}{why}");
    let event = RolloutEvent { time_ms: now_ms, caller: cause.caller, message, generation };
    append_event(write, key, number, event).await?;
    find_rollout(write.sql(), key, number).await
}

/// Ends a running rollout. The caller changes what devices get, which raises the generation.
async fn end(write: &mut Write, key: &KernelKey, number: u32, ending: Ending, now_ms: i64) -> Result<()> {
    let Ending { state, caller, message } = ending;
    let word = to_word("rollout.state", &state)?;
    query(
        "update rollout set state = $3, end_time_ms = $4, revision = revision + 1 where number = $2 \
         and kernel = (select id from kernel where name = $1)",
    )
    .bind((key.to_string(), number, word, now_ms))
    .execute(write.sql())
    .await?;
    let generation: i64 =
        scalar("select generation + 1 from display where id = $1").bind(&key.display).fetch_one(write.sql()).await?;
    let event = RolloutEvent { time_ms: now_ms, caller, message, generation: generation.unsigned_abs() };
    append_event(write, key, number, event).await
}

/// Notes what a device reports about the version of a running rollout, and halts the rollout if too many have failed.
pub(super) async fn note_report(write: &mut Write, kernel_id: i64, kernel: &Kernel, report: &Report) -> Result<()> {
    let Some(number) = kernel.rollout else { return Ok(()) };
    let key = &kernel.key;
    let Rollout { plan, .. } = find_rollout(write.sql(), key, number).await?;
    if !is_member(write.sql(), key, number, &plan, &report.device).await? {
        return Ok(());
    }
    let installed = &report.installed;
    let is_installed = installed.file.as_ref().is_some_and(|file| file.version == plan.version);
    let is_within = match (plan.self_test_loss_max, installed.self_test_loss) {
        (Some(most), Some(loss)) => loss <= most,
        _ => true,
    };
    let passed = match (installed.tried_version == Some(plan.version), is_installed) {
        (true, _) => false,
        (false, true) => is_within,
        (false, false) => return Ok(()),
    };
    let before: Option<bool> =
        scalar("select passed from rollout_report where kernel = $1 and number = $2 and device = $3")
            .bind((kernel_id, number, &report.device))
            .fetch_optional(write.sql())
            .await?;
    if !passed && before != Some(false) {
        note_failure(write, key, number, report).await?;
    }
    query(
        "insert into rollout_report values ($1, $2, $3, $4, $5) on conflict (kernel, number, device) do update set passed = excluded.passed, \
         time_ms = excluded.time_ms",
    )
    .bind((kernel_id, number, &report.device, passed, installed.report_time_ms))
    .execute(write.sql())
    .await?;
    let rollout = find_rollout(write.sql(), key, number).await?;
    // The devices are counted only if their number decides.
    if !rollout.has_failed(0) {
        return Ok(());
    }
    let known = members(write.sql(), &rollout).await?;
    if !rollout.has_failed(known) {
        return Ok(());
    }
    let (failed, reported) = (rollout.devices_failed, rollout.devices_failed + rollout.devices_passed);
    let message = format!(
        "halted: {failed} of {reported} devices failed, the last one {}; above {} of at least {} devices",
        report.device,
        show_percent(plan.failed_share_max),
        plan.devices_min.min(known)
    );
    let ending = Ending { state: RolloutState::Halted, caller: String::new(), message };
    end(write, key, number, ending, installed.report_time_ms).await?;
    raise_generation(write, key, installed.report_time_ms).await?;
    Ok(())
}

/// Takes back what a device reported in rollouts that run. An ended rollout keeps its history.
pub(super) async fn forget_reports(write: &mut Write, display: &str, device: &str) -> Result<()> {
    query(
        "delete from rollout_report where device = $2 and (kernel, number) in (select r.kernel, r.number \
         from rollout r join kernel k on k.id = r.kernel where k.display = $1 and r.state = 'running')",
    )
    .bind((display, device))
    .execute(write.sql())
    .await?;
    Ok(())
}

/// Whether a device gets the version of a rollout.
async fn is_member(
    sql: &mut Connection,
    key: &KernelKey,
    number: u32,
    plan: &RolloutPlan,
    device: &str,
) -> Result<bool> {
    let group: Option<String> = scalar("select group_name from device where display = $1 and id = $2")
        .bind((&key.display, device))
        .fetch_optional(sql)
        .await?;
    Ok(plan.includes(key, number, device, &group.unwrap_or_default()))
}

/// Number of devices that have reported about the kernel of a rollout and get its version.
async fn members(sql: &mut Connection, Rollout { key, number, plan, .. }: &Rollout) -> Result<u32> {
    let rows: Vec<(String, String)> = query_as(
        "select d.id, d.group_name from device_kernel u join device d on d.display = u.display and d.id = u.device \
         where u.kernel = (select id from kernel where name = $1)",
    )
    .bind(key.to_string())
    .fetch_all(sql)
    .await?;
    Ok(rows.iter().filter(|(device, group)| plan.includes(key, *number, device, group)).count() as u32)
}

/// Notes why a device failed, as long as the rollout has few events.
async fn note_failure(write: &mut Write, key: &KernelKey, number: u32, report: &Report) -> Result<()> {
    let installed = &report.installed;
    let why = match (installed.tried_version, installed.self_test_loss) {
        (None, Some(loss)) => format!("its self-test measured a loss of {loss}"),
        _ => installed.message.clone(),
    };
    let (message, time_ms) = (format!("{} failed: {why}", report.device), installed.report_time_ms);
    let count =
        "select count(*) from rollout_event e join kernel k on k.id = e.kernel where k.name = $1 and number = $2";
    let events: u32 = scalar(count).bind((key.to_string(), number)).fetch_one(write.sql()).await?;
    if events >= EVENTS_MAX {
        return Ok(());
    }
    let generation: i64 =
        scalar("select generation from display where id = $1").bind(&key.display).fetch_one(write.sql()).await?;
    let event = RolloutEvent { time_ms, caller: String::new(), message, generation: generation.unsigned_abs() };
    append_event(write, key, number, event).await
}

/// Raises the generation of a display whose devices changed their groups while a rollout runs: what they get changes.
pub(super) async fn note_regrouping(write: &mut Write, display: &str, now_ms: i64) -> Result<()> {
    let running = query(
        "select k.display, k.wavelength_pm, k.distance_nm from rollout r join kernel k on k.id = r.kernel \
         where k.display = $1 and r.state = 'running' and r.group_name <> ''",
    )
    .bind(display)
    .fetch_all(write.sql())
    .await?;
    for row in running {
        raise_generation(write, &key_of(&row)?, now_ms).await?;
    }
    Ok(())
}

/// A running rollout with the expected revision.
async fn running(
    sql: &mut Connection,
    key: &KernelKey,
    number: u32,
    expected_revision: Option<u32>,
) -> Result<Rollout> {
    let rollout = find_rollout(sql, key, number).await?;
    if rollout.state != RolloutState::Running {
        let message = format!("{} has ended", name(key, number));
        return Err(StoreError::precondition(PreconditionReason::RolloutEnded, message));
    }
    if expected_revision.is_some_and(|expected| expected != rollout.revision) {
        let message = format!("{} has the revision {} now; read it again", name(key, number), rollout.revision);
        return Err(StoreError::Aborted { reason: AbortReason::RolloutChanged, message });
    }
    Ok(rollout)
}

fn name(key: &KernelKey, number: u32) -> String {
    format!("{key}/rollouts/{number}")
}

async fn find_rollout(sql: &mut Connection, key: &KernelKey, number: u32) -> Result<Rollout> {
    let mut query = Builder::new(ROLLOUTS);
    query.push(" where k.name = ").push_bind(key.to_string());
    query.push(" and r.number = ").push_bind(number);
    let row = query.build().fetch_optional(sql).await?;
    rollout_of(&row.ok_or_else(|| StoreError::not_found(name(key, number)))?)
}

async fn append_event(write: &mut Write, key: &KernelKey, number: u32, event: RolloutEvent) -> Result<()> {
    query(
        "insert into rollout_event (kernel, number, time_ms, caller, message, generation) \
         select id, $2, $3, $4, $5, $6 from kernel where name = $1",
    )
    .bind((key.to_string(), number, event.time_ms, event.caller, event.message, event.generation as i64))
    .execute(write.sql())
    .await?;
    write.announce_changed(Changed::Kernel(key.clone()));
    Ok(())
}

fn rollout_of(row: &Row) -> Result<Rollout> {
    Ok(from_row!(row, Rollout {
        number, from_version, devices_passed, devices_failed, start_time_ms, end_time_ms, revision;
        key: key_of(row)?,
        plan: from_row!(row, RolloutPlan {
            version, share, failed_share_max, devices_min, self_test_loss_max;
            group: row.try_get("group_name")?,
            cause: cause_of(row)?,
            overridden: json(row, "rollout.overridden")?,
        }),
        state: word(row, "rollout.state")?,
    }))
}
