//! Devices and their reports.

use super::changes::Changed;
use super::kernels::find;
use super::moves::require_version;
use super::rollouts;
use super::rows::{from_word, key_of, to_word, word};
use super::sql::{Connection, Row, from_row, query, query_as, scalar};
use super::write::Write;
use super::{Result, Store, StoreError, page};
use lightpath_domain::device::{Device, InstalledFile, InstalledKernel, Report};
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_domain::reason::PreconditionReason;

/// Limit on the devices of a display, so that wrong ids cannot fill the disk.
pub const DEVICES_MAX: u32 = 100_000;

impl Store {
    /// Stores the report of a device, and halts a rollout that has failed by it.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the kernel or a version does not exist; [`StoreError::Precondition`] if the display
    /// has [`DEVICES_MAX`] devices.
    pub async fn report_device(&self, report: Report) -> Result<()> {
        self.write(async move |write| store_report(write, &report).await).await
    }

    /// At most `limit` devices of a display in the order of their ids, behind the id `after`.
    pub async fn devices(&self, display: &str, after: Option<&str>, limit: u32) -> Result<Vec<Device>> {
        let mut read = self.readers().begin().await?;
        let rows = query("select * from device where display = $1 and id > $2 order by id limit $3")
            .bind((display, after.unwrap_or(""), page(limit)))
            .fetch_all(&mut read)
            .await?;
        with_kernels(&mut read, display, &rows).await
    }

    /// Puts a device into a group (empty: none), and creates the device if it is unknown.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the display does not exist; [`StoreError::Precondition`] if it has [`DEVICES_MAX`]
    /// devices.
    pub async fn set_device_group(&self, display: &str, device: &str, group: &str, now_ms: i64) -> Result<Device> {
        let (display, device, group) = (display.to_owned(), device.to_owned(), group.to_owned());
        self.write(async move |write| {
            create(write.sql(), &display, &device).await?;
            let regroup = "update device set group_name = $3 where display = $1 and id = $2 and group_name <> $3";
            let changed = query(regroup).bind((&display, &device, &group)).execute(write.sql()).await?;
            if changed > 0 {
                write.announce_changed(device_changed(&display, &device));
                rollouts::note_regrouping(write, &display, now_ms).await?;
            }
            let row = query("select * from device where display = $1 and id = $2")
                .bind((&display, &device))
                .fetch_one(write.sql())
                .await?;
            let devices = with_kernels(write.sql(), &display, &[row]).await?;
            devices.into_iter().next().ok_or_else(|| not_found(&display, &device))
        })
        .await
    }

    /// Forgets a device and its reports, also those that count in rollouts that run.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn delete_device(&self, display: &str, device: &str) -> Result<()> {
        let (display, device) = (display.to_owned(), device.to_owned());
        self.write(async move |write| {
            let delete = "delete from device where display = $1 and id = $2";
            let deleted = query(delete).bind((&display, &device)).execute(write.sql()).await?;
            if deleted == 0 {
                return Err(not_found(&display, &device));
            }
            write.announce_changed(device_changed(&display, &device));
            rollouts::forget_reports(write, &display, &device).await
        })
        .await
    }

    /// The groups that devices of a display are in, in the order of their names.
    pub async fn device_groups(&self, display: &str) -> Result<Vec<String>> {
        let mut read = self.readers().begin().await?;
        let groups =
            "select distinct group_name from device where display = $1 and group_name <> '' order by group_name";
        Ok(scalar(groups).bind(display).fetch_all(&mut read).await?)
    }

    /// The forms of a kernel that devices use.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the kernel does not exist.
    pub async fn forms_in_use(&self, key: &KernelKey) -> Result<Vec<KernelFormat>> {
        let mut read = self.readers().begin().await?;
        let (id, _) = find(&mut read, key).await?;
        let words: Vec<String> =
            scalar("select distinct form from device_kernel where kernel = $1 and form <> '' order by form")
                .bind(id)
                .fetch_all(&mut read)
                .await?;
        words.into_iter().map(|word| from_word("device_kernel.form", word)).collect()
    }
}

async fn store_report(write: &mut Write, report: &Report) -> Result<()> {
    let Report { device, agent, installed } = report;
    let (id, kernel) = find(write.sql(), &installed.kernel).await?;
    let file = installed.file.as_ref();
    for version in file.map(|file| file.version).into_iter().chain(installed.tried_version) {
        require_version(&kernel, version)?;
    }
    let display = &installed.kernel.display;
    create(write.sql(), display, device).await?;
    query("update device set agent = $1, report_time_ms = $2 where display = $3 and id = $4")
        .bind((agent, installed.report_time_ms, display, device))
        .execute(write.sql())
        .await?;
    query(
        "insert into device_kernel values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11) \
         on conflict (display, device, kernel) do update set \
         version = excluded.version, form = excluded.form, digest = excluded.digest, \
         generation = excluded.generation, tried_version = excluded.tried_version, message = excluded.message, \
         self_test_loss = excluded.self_test_loss, report_time_ms = excluded.report_time_ms",
    )
    .bind((display, device, id, file.map(|file| file.version)))
    .bind(file.map(|file| to_word("device_kernel.form", &file.form)).transpose()?.unwrap_or_default())
    .bind((file.map(|file| file.digest.as_str()).unwrap_or_default(), installed.generation as i64))
    .bind((installed.tried_version, &installed.message, installed.self_test_loss, installed.report_time_ms))
    .execute(write.sql())
    .await?;
    write.announce_changed(device_changed(display, device));
    rollouts::note_report(write, id, &kernel, report).await
}

fn device_changed(display: &str, device: &str) -> Changed {
    Changed::Device { display: display.to_owned(), id: device.to_owned() }
}

/// Creates a device if it is unknown.
async fn create(sql: &mut Connection, display: &str, device: &str) -> Result<()> {
    let state = "select exists (select 1 from display where id = $1), \
                 exists (select 1 from device where display = $1 and id = $2)";
    let (display_exists, device_exists): (bool, bool) =
        query_as(state).bind((display, device)).fetch_one(&mut *sql).await?;
    if !display_exists {
        return Err(StoreError::not_found(format!("displays/{display}")));
    }
    if device_exists {
        return Ok(());
    }
    let devices: u32 =
        scalar("select count(*) from device where display = $1").bind(display).fetch_one(&mut *sql).await?;
    if devices >= DEVICES_MAX {
        let message = format!("displays/{display} has {DEVICES_MAX} devices, which is the limit; delete old ones");
        return Err(StoreError::precondition(PreconditionReason::DevicesFull, message));
    }
    query("insert into device (display, id) values ($1, $2)").bind((display, device)).execute(sql).await?;
    Ok(())
}

fn not_found(display: &str, device: &str) -> StoreError {
    StoreError::not_found(format!("displays/{display}/devices/{device}"))
}

/// The devices of rows that are in the order of their ids, with their kernels.
async fn with_kernels(sql: &mut Connection, display: &str, rows: &[Row]) -> Result<Vec<Device>> {
    let mut devices = rows.iter().map(|row| device_of(display, row)).collect::<Result<Vec<_>, _>>()?;
    let (Some(first), Some(last)) = (devices.first(), devices.last()) else { return Ok(devices) };
    let kernels = query(
        "select d.*, k.wavelength_pm, k.distance_nm from device_kernel d join kernel k on k.id = d.kernel \
         where d.display = $1 and d.device between $2 and $3 order by d.device, k.name",
    )
    .bind((display, &first.id, &last.id))
    .fetch_all(sql)
    .await?;
    let mut kernels = kernels.iter().peekable();
    for device in &mut devices {
        while let Some(row) = kernels.peek() {
            if row.try_get::<String>("device")? != device.id {
                break;
            }
            device.kernels.push(installed_of(row)?);
            kernels.next();
        }
    }
    Ok(devices)
}

fn device_of(display: &str, row: &Row) -> Result<Device> {
    Ok(from_row!(row, Device {
        id, agent, report_time_ms;
        display: display.to_owned(),
        kernels: Vec::new(),
        group: row.try_get("group_name")?,
    }))
}

fn installed_of(row: &Row) -> Result<InstalledKernel> {
    let file = match row.try_get("version")? {
        None => None,
        Some(version) => {
            Some(InstalledFile { version, form: word(row, "device_kernel.form")?, digest: row.try_get("digest")? })
        }
    };
    Ok(from_row!(row, InstalledKernel {
        generation, tried_version, message, self_test_loss, report_time_ms;
        kernel: key_of(row)?,
        file,
    }))
}
