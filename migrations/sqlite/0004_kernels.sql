-- Kernels: learned light transport for a display, wavelength and distance, with numbered versions.
create table kernel (
    id             integer primary key,
    -- resource name, which gives the order of lists
    name           text    not null unique,
    display        text    not null references display (id),
    wavelength_pm  integer not null check (wavelength_pm > 0),
    distance_nm    integer not null check (distance_nm <> 0),
    active_version integer,
    latest_version integer not null default 0 check (latest_version >= 0),
    create_time_ms integer not null,
    unique (display, wavelength_pm, distance_nm),
    foreign key (id, active_version) references kernel_version (kernel, version)
) strict;

create table kernel_version (
    kernel         integer not null references kernel (id),
    version        integer not null check (version >= 1),
    model          text    not null check (model in ('paper', 'dense', 'smooth', 'display', 'varying')),
    artifact       text    not null references artifact (digest),
    size_bytes     integer not null check (size_bytes >= 0),
    metrics        text    not null check (json_valid(metrics)),
    lineage        text    not null check (json_valid(lineage)),
    create_time_ms integer not null,
    -- of the lineage: whether the version was interpolated, the number of its datasets, and its job (empty: imported)
    interpolated   integer not null check (interpolated in (0, 1)),
    datasets       integer not null check (datasets >= 0),
    job            text    not null,
    primary key (kernel, version)
) strict, without rowid;

create index kernel_version_by_artifact on kernel_version (artifact);

create trigger kernel_version_stays before update on kernel_version
begin select raise(abort, 'kernel versions are immutable'); end;

-- Names for versions besides `active`. Devices follow only `active`.
create table kernel_alias (
    kernel  integer not null references kernel (id),
    alias   text    not null check (length(alias) between 1 and 63 and alias <> 'active'),
    version integer not null,
    primary key (kernel, alias),
    foreign key (kernel, version) references kernel_version (kernel, version)
) strict, without rowid;

-- History of the aliases. A rollback names the move of `active` that it undoes, and no move is undone twice. So the
-- moves of `active` that are not undone form a stack, and the next rollback undoes the top one.
create table kernel_move (
    sequence     integer primary key autoincrement,
    kernel       integer not null references kernel (id),
    alias        text    not null,
    time_ms      integer not null,
    caller       text    not null,
    from_version integer,
    -- null: the alias was removed
    to_version   integer,
    reason       text    not null,
    -- what failed of the promotion gate and was overridden
    overridden   text    not null default '[]' check (json_valid(overridden)),
    -- generation of the display after the move
    generation   integer not null check (generation >= 0),
    undoes       integer unique references kernel_move (sequence),
    foreign key (kernel, from_version) references kernel_version (kernel, version),
    foreign key (kernel, to_version) references kernel_version (kernel, version),
    check (to_version is not null or alias <> 'active')
) strict;

create index kernel_move_by_kernel on kernel_move (kernel, sequence);

create trigger kernel_move_stays before update on kernel_move
begin select raise(abort, 'the history of a kernel is append-only'); end;

create trigger kernel_move_is_kept before delete on kernel_move
begin select raise(abort, 'the history of a kernel is append-only'); end;

-- Deprecations and their withdrawals. The newest row of a version counts.
create table kernel_deprecation (
    sequence   integer primary key autoincrement,
    kernel     integer not null,
    version    integer not null,
    deprecated integer not null check (deprecated in (0, 1)),
    time_ms    integer not null,
    caller     text    not null,
    reason     text    not null,
    foreign key (kernel, version) references kernel_version (kernel, version)
) strict;

create index kernel_deprecation_by_version on kernel_deprecation (kernel, version, sequence);

create trigger kernel_deprecation_stays before update on kernel_deprecation
begin select raise(abort, 'the history of a kernel is append-only'); end;

create trigger kernel_deprecation_is_kept before delete on kernel_deprecation
begin select raise(abort, 'the history of a kernel is append-only'); end;

-- What a version must show before it becomes active on a display. The newest row of a display counts.
create table promotion_gate (
    sequence integer primary key autoincrement,
    display  text    not null references display (id) on delete cascade,
    time_ms  integer not null,
    caller   text    not null,
    reason   text    not null,
    gate     text    not null check (json_valid(gate))
) strict;

create index promotion_gate_by_display on promotion_gate (display, sequence);

create trigger promotion_gate_stays before update on promotion_gate
begin select raise(abort, 'the history of promotion gates is append-only'); end;

-- Requests with an id of their caller that made a version or a rollout. Repeated, they return what they made.
create table made_by_request (
    caller     text    not null,
    request_id text    not null check (length(request_id) between 1 and 128),
    -- kind and digest of the request: another one with the same id is refused
    content    text    not null,
    -- number of the version or the rollout, in the kernel that the request names
    number     integer not null check (number >= 1),
    time_ms    integer not null,
    primary key (caller, request_id)
) strict, without rowid;

create index made_by_request_by_time on made_by_request (time_ms);
