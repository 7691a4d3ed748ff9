-- API tokens, identified by their SHA-256 only. A name is never used for another token, so names in the audit log are
-- unambiguous.
create table token (
    name           text collate "C" not null primary key check (length(name) between 1 and 63),
    hash           text collate "C" not null unique check (length(hash) = 64),
    role           text collate "C" not null check (role in ('viewer', 'submitter', 'curator', 'firmware', 'rig', 'admin')),
    -- ids of the displays for which the token is valid, as JSON; empty: all displays
    displays       text collate "C" not null check (json_valid(displays)),
    create_time_ms bigint           not null,
    expire_time_ms bigint,
    revoke_time_ms bigint,
    -- a firmware token is valid for named displays only, never for all
    check (role not in ('firmware', 'rig') or json_array_length(displays) > 0)
);

create trigger revoked_token_stays before update on token for each row
when (old.revoke_time_ms is not null and new.revoke_time_ms is distinct from old.revoke_time_ms)
execute function refuse('the token is revoked');
