//! The display service.

use super::update::changed_notes;
use super::{from_wire, to_wire};
use crate::api::Api;
use crate::call::answers;
use crate::names;
use crate::pages::Page;
use lightpath_proto::v1;
use lightpath_proto::v1::display_service_server::DisplayService;
use lightpath_service::{Call, Field, Result};

answers! {
    DisplayService {
        create_display(v1::CreateDisplayRequest) -> v1::Display;
        get_display(v1::GetDisplayRequest) -> v1::Display;
        list_displays(v1::ListDisplaysRequest) -> v1::ListDisplaysResponse;
        plan_propagation(v1::PlanPropagationRequest) -> v1::PlanPropagationResponse;
        update_display(v1::UpdateDisplayRequest) -> v1::Display;
        delete_display(v1::DeleteDisplayRequest) -> v1::DeleteDisplayResponse;
    }
}

impl Api {
    async fn create_display(&self, call: &Call, request: v1::CreateDisplayRequest) -> Result<v1::Display> {
        let field = Field::new("display");
        let display = from_wire::display(call, field.required(request.display)?, &field)?;
        call.concerns(format!("displays/{}", display.id));
        Ok(to_wire::display(self.service.displays.create(&display).await?))
    }

    async fn get_display(&self, call: &Call, request: v1::GetDisplayRequest) -> Result<v1::Display> {
        let id = names::display_id(call, &Field::new("name"), &request.name)?;
        Ok(to_wire::display(self.store.display(&id).await?))
    }

    async fn list_displays(&self, call: &Call, request: v1::ListDisplaysRequest) -> Result<v1::ListDisplaysResponse> {
        let page = Page::new(&["displays"], request.page_size, &request.page_token)?;
        let displays = self.service.displays.visible(call, page.after.clone(), page.limit()).await?;
        let (displays, next_page_token) = page.fill(displays, |(display, _)| display.id.clone(), to_wire::display);
        Ok(v1::ListDisplaysResponse { displays, next_page_token })
    }

    async fn update_display(&self, call: &Call, request: v1::UpdateDisplayRequest) -> Result<v1::Display> {
        let field = Field::new("display");
        let message = field.required(request.display)?;
        let id = names::display_id(call, &field.at("name"), &message.name)?;
        call.concerns(format!("displays/{id}"));
        let stored = self.store.display(&id).await?;
        let notes = changed_notes(
            message,
            to_wire::display(stored.clone()),
            request.update_mask.map(|mask| mask.paths),
            &field,
        )?;
        let notes = notes.unwrap_or(stored.0.notes);
        Ok(to_wire::display(self.service.displays.set_notes(&id, notes, request.expected_revision).await?))
    }

    async fn delete_display(
        &self,
        call: &Call,
        request: v1::DeleteDisplayRequest,
    ) -> Result<v1::DeleteDisplayResponse> {
        let id = names::display_id(call, &Field::new("name"), &request.name)?;
        call.concerns(format!("displays/{id}"));
        self.service.displays.delete(&id).await?;
        Ok(v1::DeleteDisplayResponse {})
    }
}
