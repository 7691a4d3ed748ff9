-- Displays in the field.
create table device (
    display        text    not null references display (id) on delete cascade,
    id             text    not null check (length(id) between 1 and 63),
    -- group for rollouts; empty: none
    group_name     text    not null default '' check (length(group_name) <= 63),
    -- program of the device, as it reported
    agent          text    not null default '' check (length(agent) <= 128),
    -- null: it has not reported yet
    report_time_ms integer,
    primary key (display, id)
) strict, without rowid;

-- The kernel that a device uses at a wavelength and distance, by its last report.
create table device_kernel (
    display        text    not null,
    device         text    not null,
    kernel         integer not null references kernel (id),
    version        integer,
    form           text    not null,
    digest         text    not null,
    generation     integer not null check (generation >= 0),
    -- a version that the device tried and gave up
    tried_version  integer,
    message        text    not null,
    self_test_loss real,
    report_time_ms integer not null,
    primary key (display, device, kernel),
    foreign key (display, device) references device (display, id) on delete cascade,
    foreign key (kernel, version) references kernel_version (kernel, version),
    foreign key (kernel, tried_version) references kernel_version (kernel, version)
) strict, without rowid;

-- for the forms that the devices of a kernel use
create index device_kernel_by_kernel on device_kernel (kernel, form);

-- Staged rollouts: a version goes to some devices first.
create table rollout (
    kernel             integer not null references kernel (id),
    number             integer not null check (number >= 1),
    version            integer not null,
    from_version       integer,
    state              text    not null check (state in ('running', 'completed', 'halted')),
    share              real    not null check (share between 0 and 1),
    group_name         text    not null,
    failed_share_max   real    not null check (failed_share_max between 0 and 1),
    devices_min        integer not null check (devices_min >= 1),
    self_test_loss_max real,
    -- who started it and why, and what was overridden: for the move of `active` at its end
    caller             text    not null,
    reason             text    not null,
    overridden         text    not null check (json_valid(overridden)),
    start_time_ms      integer not null,
    end_time_ms        integer,
    revision           integer not null default 1 check (revision >= 1),
    primary key (kernel, number),
    foreign key (kernel, version) references kernel_version (kernel, version),
    foreign key (kernel, from_version) references kernel_version (kernel, version),
    check ((state = 'running') = (end_time_ms is null))
) strict, without rowid;

create unique index rollout_running on rollout (kernel) where state = 'running';

create trigger ended_rollout_stays before update on rollout
when old.state <> 'running'
begin select raise(abort, 'the rollout has ended'); end;

-- Events of rollouts, for people.
create table rollout_event (
    sequence   integer primary key autoincrement,
    kernel     integer not null,
    number     integer not null,
    time_ms    integer not null,
    caller     text    not null,
    message    text    not null,
    -- generation of the display afterwards
    generation integer not null,
    foreign key (kernel, number) references rollout (kernel, number)
) strict;

create index rollout_event_by_rollout on rollout_event (kernel, number, sequence);

create trigger rollout_event_stays before update on rollout_event
begin select raise(abort, 'the history of a rollout is append-only'); end;

create trigger rollout_event_is_kept before delete on rollout_event
begin select raise(abort, 'the history of a rollout is append-only'); end;

-- What the devices reported about the version of a rollout. The last report of a device counts.
create table rollout_report (
    kernel  integer not null,
    number  integer not null,
    device  text    not null,
    passed  integer not null check (passed in (0, 1)),
    time_ms integer not null,
    primary key (kernel, number, device),
    foreign key (kernel, number) references rollout (kernel, number)
) strict, without rowid;
